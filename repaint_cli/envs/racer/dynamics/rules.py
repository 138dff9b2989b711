"""The rules of an episode: how it ends, and the reward terms φ. SI units, progress in percent.

A rule is a function of one car's numbers, `…_one`, that kernels call, and one of arrays over cars.
"""

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.dynamics.encounters import CLEAR, DISTANCE, HAZARDS, NEXT_SEEN
from repaint_cli.envs.racer.dynamics.progress import Counters
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.track.geometry import (
    CENTRE_GAP,
    INNER_GAP,
    OUTER_GAP,
    ROAD_WIDTH,
    WHEELS_ON,
    Floats,
)
from repaint_cli.kernels import kernel

IN_PROGRESS, LAP_COMPLETE, OFF_TRACK, IMMOBILIZED, REVERSED, TIME_UP, CRASHED = range(len(STATUS))

PATIENCE = 15
"""Steps in a row without movement, or with falling progress, that end an episode."""
KEEP_MARGIN = 0.05
"""Room between the front point and the road's edge that counts as keeping the road, m."""


TERMS, TRAFFIC_TERMS = ("lane", "keep", "dprog", "fail"), ("clear", "hazard", "camlane")
"""What `terms_one` and `traffic_terms_one` return, in their order."""


@kernel
def status_one(
    wheels_on: float, progress: float, crashed: bool, steps: int, still: int, backwards: int,
    max_steps: int,
) -> int:  # fmt: skip
    """Return one car's status; see `status_of`."""
    status = IN_PROGRESS
    if wheels_on == 0 and not progress >= 100:
        status = OFF_TRACK
    elif crashed:
        status = CRASHED
    elif progress >= 100:
        status = LAP_COMPLETE
    elif still >= PATIENCE:
        status = IMMOBILIZED
    elif backwards >= PATIENCE:
        status = REVERSED
    elif steps >= max_steps:
        status = TIME_UP
    return status


@kernel
def _status_rows(
    wheels_on: np.ndarray, progress: np.ndarray, crashed: np.ndarray, steps: np.ndarray,
    still: np.ndarray, backwards: np.ndarray, max_steps: int, status: np.ndarray,
) -> None:  # fmt: skip
    for k in range(len(status)):
        status[k] = status_one(
            wheels_on[k], progress[k], crashed[k], steps[k], still[k], backwards[k], max_steps
        )  # fmt: skip


def status_of(
    measures: Floats,
    progress: Floats,
    counters: Counters,
    max_steps: int,
    crashed: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Return each car's status, (N,): leaving the track outranks the rest, the time limit is last.

    But coming all the way round outranks leaving the track there, as in DeepRacer's logs; at the
    end of an open track the road ends, too.

    Args:
        measures: `geometry.locate`'s answers, (N, 6).
        progress: percent, (N,).
        counters: of the same cars.
        max_steps: the time limit, steps.
        crashed: whether it hit an object and that ends the episode, (N,).
    """
    status = np.empty(len(progress), np.int64)
    _status_rows(
        measures[:, WHEELS_ON], progress, crashed, counters.steps, counters.still,
        counters.backwards, max_steps, status,
    )  # fmt: skip
    return status


@kernel
def terms_one(
    wheels_on: float, centre_gap: float, inner_gap: float, outer_gap: float, road_width: float,
    gained: float, status: int,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return one car's `TERMS`; see `reward_terms`."""
    side = 1.0 if inner_gap < outer_gap else -1.0
    keeps = wheels_on == 4 and road_width / 2 - centre_gap >= KEEP_MARGIN
    fails = status in (OFF_TRACK, CRASHED)
    return (
        side if wheels_on > 0 else 0.0, 1.0 if keeps else 0.0, gained / 100,
        1.0 if fails else 0.0,
    )  # fmt: skip


@kernel
def _terms_rows(
    wheels_on: np.ndarray, centre_gap: np.ndarray, inner_gap: np.ndarray, outer_gap: np.ndarray,
    road_width: np.ndarray, gained: np.ndarray, status: np.ndarray, terms: np.ndarray,
) -> None:  # fmt: skip
    for k in range(len(status)):
        terms[0, k], terms[1, k], terms[2, k], terms[3, k] = terms_one(
            wheels_on[k], centre_gap[k], inner_gap[k], outer_gap[k], road_width[k], gained[k],
            status[k],
        )  # fmt: skip


def reward_terms(measures: Floats, gained: Floats, status: NDArray[np.int64]) -> dict[str, Floats]:
    """Return the reward terms φ of one step, each (N,).

    lane is +1 with the front point nearer the inner border, −1 nearer the outer, 0 with no wheel on
    the road. keep is 1 with all wheels on the road and the front point at least 0.05 m inside its
    edge. dprog is the progress gained, in laps. fail is 1 on the step that leaves the track or
    crashes.

    Args:
        measures: `geometry.locate`'s answers, (N, 6).
        gained: progress gained in this step, percent, (N,).
        status: `status_of` after this step, (N,).
    """
    terms = np.empty((len(TERMS), len(status)))
    _terms_rows(
        measures[:, WHEELS_ON], measures[:, CENTRE_GAP], measures[:, INNER_GAP],
        measures[:, OUTER_GAP], measures[:, ROAD_WIDTH], gained, status, terms,
    )  # fmt: skip
    return dict(zip(TERMS, terms, strict=True))


@kernel
def traffic_terms_one(
    encounter: np.ndarray, next_side: float, lane: float
) -> tuple[float, float, float]:
    """Return one car's `TRAFFIC_TERMS` of its `encounters.meet` (6,); see `traffic_terms`."""
    own_lane = encounter[NEXT_SEEN] > 0 and next_side * lane > 0
    return (
        1.0 if encounter[DISTANCE] > CLEAR else 0.0, 1.0 if encounter[HAZARDS] > 0 else 0.0,
        1.0 if own_lane else 0.0,
    )  # fmt: skip


@kernel
def _traffic_rows(
    encounters: np.ndarray, next_sides: np.ndarray, lane: np.ndarray, terms: np.ndarray
) -> None:
    for k in range(len(lane)):
        terms[0, k], terms[1, k], terms[2, k] = traffic_terms_one(
            encounters[k], next_sides[k], lane[k]
        )


def traffic_terms(encounters: Floats, next_sides: Floats, lane: Floats) -> dict[str, Floats]:
    """Return the reward terms φ of a step that objects are part of, each (N,).

    clear is 1 with every object more than 0.8 m away, middle to middle. hazard is 1 with one nearer
    than 0.5 m and less than 30° off the bow. camlane is 1 with the next object in the picture and
    in the car's own lane.

    Args:
        encounters: `encounters.meet`'s answers, (N, 6).
        next_sides: the side of each car's next object, (N,).
        lane: the term of that name, (N,).
    """
    terms = np.empty((len(TRAFFIC_TERMS), len(lane)))
    _traffic_rows(encounters, next_sides, lane, terms)
    return dict(zip(TRAFFIC_TERMS, terms, strict=True))
