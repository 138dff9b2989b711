"""Any environment of Gymnasium, by its id, as a simulator."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, JsonValue, field_validator

from repaint_cli.envs.gymnasium.symmetries import symmetries_of, unknown_because
from repaint_cli.envs.simulator import Simulator
from repaint_cli.errors import CardError
from repaint_cli.settings import EvalConfig
from repaint_cli.symmetry import Symmetry

if TYPE_CHECKING:
    from repaint_cli.envs.episodes import Episodes
    from repaint_cli.envs.paths import PathFormat
    from repaint_cli.envs.simulator import Environments

REACHER = "Reacher-v5"
"""The environment whose fingertip's paths are drawn."""

PLATFORMS = {
    "Reacher": "reacher", "Ant": "ant",
    **dict.fromkeys(("HalfCheetah", "Hopper", "Humanoid", "HumanoidStandup", "InvertedPendulum",
                     "InvertedDoublePendulum", "Pusher", "Swimmer", "Walker2d"), "mujoco"),
}  # fmt: skip
"""The paper's name of MuJoCo's environments."""

LONGEST_STEP = 1_000
"""Frames of the simulator in a step: nothing can interrupt one, and a card may be a stranger's."""


class GymnasiumSimulator(Simulator):
    """An environment of Gymnasium, by id."""

    simulator: Literal["gymnasium"]
    """Which simulator this is."""
    id: str
    """The environment's id, as in `gymnasium.make`."""
    backend: Literal["auto", "envpool", "gymnasium"] = "auto"
    """Who steps it: EnvPool where installed and checked to be equal, else Gymnasium."""
    kwargs: dict[str, JsonValue] = Field(default_factory=dict)
    """Arguments for the environment: numbers, texts, lists and tables of them."""

    position: tuple[str, str] | None = None
    """Two numbers of its info, by name, whose path is drawn; they count as x and y."""

    @field_validator("kwargs")
    @classmethod
    def _of_the_environment(cls, kwargs: dict[str, Any]) -> dict[str, Any]:
        """Refuse what Gymnasium itself would take: windows, other time limits, wrappers."""
        for name in ("render_mode", "max_episode_steps", "num_envs", "disable_env_checker"):
            if name in kwargs:
                raise ValueError(f"expected arguments of the environment itself, found {name}")
        skip = kwargs.get("frame_skip", 1)
        if not isinstance(skip, int) or not 0 < skip <= LONGEST_STEP:
            raise ValueError(f"expected a whole frame_skip from 1 to {LONGEST_STEP:,}")
        for name, value in kwargs.items():
            if any(part is None for part in _parts_of(value)):
                raise ValueError(f"expected numbers, texts, lists or tables as {name}")
        return kwargs

    @property
    def platform(self) -> str | None:
        """The paper's Reacher or Ant, or another environment of MuJoCo's."""
        return PLATFORMS.get(self.id.rpartition("-v")[0])

    def make(
        self, n_envs: int, one_episode: bool, noise: EvalConfig | None, training: bool = False
    ) -> "Environments":
        """Make N copies; they have no noise. See `Simulator.make`."""
        from repaint_cli.envs.gymnasium.vector import make_gym

        return make_gym(self.id, n_envs, self.kwargs, self.backend)

    def make_replayable(self, n_envs: int) -> "Environments | None":
        """Make N copies whose episodes can be played again; EnvPool's cannot."""
        from repaint_cli.envs.gymnasium.replay import EpisodeSeeds
        from repaint_cli.envs.gymnasium.vector import make_gym, on_envpool

        if on_envpool(self.id, self.kwargs, self.backend):
            return None
        return make_gym(self.id, n_envs, self.kwargs, self.backend, (EpisodeSeeds,))

    def longest_episode(self) -> int:
        """Return the time limit, in steps; see `Simulator.longest_episode`."""
        from repaint_cli.envs.gymnasium.ids import spec_of
        from repaint_cli.envs.output import captured

        with captured():  # the module may print
            limit = spec_of(self.id).max_episode_steps
        if limit is None:
            raise CardError(
                f"'{self.id}' has no time limit, so an evaluation might never end; "
                "register it with max_episode_steps"
            )
        return limit

    def same_world(self, other: Simulator) -> bool:
        """Return whether both are the same environment: only its infos show its terms."""
        return isinstance(other, GymnasiumSimulator) and self.id == other.id

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Return the known reflections of the environment, unless an argument may change them."""
        return symmetries_of(self.id, self.kwargs)

    def why_no_symmetry(self) -> str | None:
        """Return why no symmetry is known; see `Simulator.why_no_symmetry`."""
        return unknown_because(self.id, self.kwargs)

    def code_at_risk(self) -> str | None:
        """Return the module that is imported, or a file that the environment reads."""
        if ":" in self.id:
            return f"the module of {self.id}"
        for name, value in self.kwargs.items():
            for text in filter(lambda part: isinstance(part, str), _parts_of(value)):
                if "/" in text or "\\" in text or "." in text:
                    return f"the file {text} ({name})"
        return None

    @property
    def place(self) -> str:
        """The environment."""
        return self.id

    @property
    def records(self) -> tuple[str, ...]:
        """The position, where the card names one."""
        return self.position or ()

    @property
    def paths(self) -> "PathFormat | None":
        """Those of the position that the card names, or of Reacher's fingertip."""
        from repaint_cli.envs.gymnasium.paths import PositionPaths, ReacherPaths

        if self.position:
            return PositionPaths(self.position)
        return ReacherPaths() if self.id == REACHER else None

    def for_replay(self) -> "GymnasiumSimulator":
        """Return Gymnasium's own environment: EnvPool's cannot be drawn."""
        return self.model_copy(update={"backend": "gymnasium"})

    def film(self, episodes: "Episodes", path: Path, title: str, n_episodes: int) -> None:
        """Play the first seed's first episodes again and film them; see `Simulator.film`."""
        from repaint_cli.envs.gymnasium.film import Replay, render_gym

        replays = []
        for e in range(n_episodes):
            steps = slice(episodes.lengths[0, e]), 0, e
            replays.append(
                Replay(episodes.env_seeds[e], episodes.actions[steps], episodes.rewards[steps])
            )
        render_gym(self.id, self.kwargs, replays, path, title=title)


def _parts_of(value: Any) -> Iterator[Any]:
    """Yield all numbers and texts of an argument, and the names in its tables."""
    if isinstance(value, dict):
        yield from value
        value = list(value.values())
    if isinstance(value, list):
        for part in value:
            yield from _parts_of(part)
    else:
        yield value
