"""Checks of what callers give the racer: settings, actions and start options."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track

CRASHES = ("at-fault", "any")
"""Which crashes end an episode."""
DEVICES = ("cpu", "cuda")
"""Where cars drive."""


def check_positive(**numbers: int) -> None:
    """Check that settings are at least 1.

    Raises:
        ValueError: a setting is less than 1.
    """
    for name, value in numbers.items():
        if value < 1:
            raise ValueError(f"expected {name} of at least 1, found {value}")


def check_closed(what: str, tracks: Iterable[Track]) -> None:
    """Check that tracks are closed, as what is to be on them needs it.

    Raises:
        ValueError: a track is open.
    """
    for track in tracks:
        if not track.closed:
            raise ValueError(
                f"expected a closed track for {what}, found '{track.name}', an open one"
            )


def check_names(**names: tuple[str, Iterable[str]]) -> None:
    """Check that settings, each given with its possible values, are among these.

    Raises:
        ValueError: a value is unknown.
    """
    for what, (name, known) in names.items():
        if name not in known:
            raise ValueError(f"unknown {what} '{name}'; choose one of {', '.join(known)}")


def check_autoreset(mode: AutoresetMode) -> None:
    """Check that an environment starts anew after an episode, or its car parks.

    Raises:
        ValueError: the mode is another one.
    """
    if mode not in (AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED):
        raise ValueError(f"expected autoreset NEXT_STEP or DISABLED, found {mode}")


def checked_actions(actions: NDArray[np.int64], n: int, n_actions: int) -> NDArray[np.int64]:
    """Return actions as an array (N,).

    Raises:
        ValueError: the actions are not N integers from 0 to A − 1.
    """
    actions = np.asarray(actions)
    if actions.shape != (n,) or actions.dtype.kind not in "iu":
        raise ValueError(
            f"expected {n} integer actions, found shape {actions.shape} of {actions.dtype}"
        )
    if actions.min() < 0 or actions.max() >= n_actions:
        raise ValueError(f"expected actions from 0 to {n_actions - 1}, found {actions}")
    return actions


def checked_pairs(actions: NDArray[Any], n: int) -> NDArray[Any]:
    """Return actions of two numbers as an array (N, 2).

    Raises:
        ValueError: the actions are not N times two finite numbers.
    """
    actions = np.asarray(actions)
    if actions.shape != (n, 2) or actions.dtype.kind not in "fiu":
        raise ValueError(
            f"expected {n} actions of two numbers, found shape {actions.shape} of {actions.dtype}"
        )
    if not np.isfinite(actions).all():
        raise ValueError(f"expected finite numbers as actions, found {actions}")
    return actions


def tracks_of(options: dict[str, Any] | None, n: int, n_tracks: int) -> NDArray[np.int64] | None:
    """Return the start option "track", (N,), which track each drives; None where it is absent.

    Raises:
        ValueError: the tracks are not N integers from 0 to the number of tracks.
    """
    if options is None or "track" not in options:
        return None
    tracks = np.array(options["track"])
    whole = tracks.shape == (n,) and tracks.dtype.kind in "iu"
    if not whole or tracks.min() < 0 or tracks.max() >= n_tracks:
        raise ValueError(f"expected {n} tracks from 0 to {n_tracks - 1}, found {tracks}")
    return tracks.astype(np.int64)


def flags_of(options: dict[str, Any] | None, name: str, n: int) -> NDArray[np.bool_]:
    """Return a start option that is a yes or no for each of N cars, (N,); no where it is absent.

    Raises:
        ValueError: it is neither one for all nor N of them.
    """
    flags = np.zeros(n, np.bool_)
    if options and name in options:
        if np.shape(options[name]) not in ((), (n,)):
            raise ValueError(f"expected {n} times whether {name}, found {options[name]!r:.60}")
        flags[:] = options[name]
    return flags


def lap_fractions_of(options: dict[str, Any] | None, n: int) -> Floats | None:
    """Return the start option "lap_fraction", (N,), in [0, 1); None where it is absent.

    Raises:
        ValueError: the fractions are not N finite numbers.
    """
    if options is None or "lap_fraction" not in options:
        return None
    fractions = np.array(options["lap_fraction"], dtype=np.float64)
    if fractions.shape != (n,) or not np.isfinite(fractions).all():
        raise ValueError(f"expected {n} finite lap fractions, found {fractions}")
    return np.mod(fractions, 1.0)
