"""How bots move: each keeps a lane at a constant speed, and changes it at times. SI.

A place on the road is an arclength along the centre line and a side: +1 is midway between the
centre line and the inner border, −1 midway to the outer one; between them a bot changes lanes. Bots
do not brake for other cars, as DeepRacer's do not.
"""

import numpy as np

from repaint_cli.kernels import kernel

HALF_BASE = 0.08
"""A bot heads where its axles, this far before and behind its middle, lead it, m."""

X, Y, YAW, SIDE = range(4)
"""Columns of a pose: middle (m), heading (rad) and side, from −1 to 1."""


@kernel
def lane_point(
    centre: np.ndarray,
    distances: np.ndarray,
    inner: np.ndarray,
    outer: np.ndarray,
    along: float,
    side: float,
) -> tuple[float, float]:
    """Return x and y of a place on the road: arclength `along`, side from −1 to 1, m."""
    along = along % distances[-1]
    i = min(int(np.searchsorted(distances, along, side="right")) - 1, len(centre) - 2)
    share = (along - distances[i]) / (distances[i + 1] - distances[i])
    border = inner if side > 0.0 else outer
    reach = abs(side) / 2.0
    x = centre[i, 0] + share * (centre[i + 1, 0] - centre[i, 0])
    y = centre[i, 1] + share * (centre[i + 1, 1] - centre[i, 1])
    bx = border[i, 0] + share * (border[i + 1, 0] - border[i, 0])
    by = border[i, 1] + share * (border[i + 1, 1] - border[i, 1])
    return x + reach * (bx - x), y + reach * (by - y)


@kernel
def side_at(goal: float, changed: float) -> float:
    """Return the side, from −1 to 1, of a bot whose change to `goal` is done by a share."""
    share = min(max(changed, 0.0), 1.0)
    return goal * (2.0 * share * share * (3.0 - 2.0 * share) - 1.0)


@kernel
def place_bot(
    centre: np.ndarray, distances: np.ndarray, inner: np.ndarray, outer: np.ndarray, where: float,
    goal: float, share: float, reach: float, pose: np.ndarray,
) -> None:  # fmt: skip
    """Fill a pose, (4,), at an arclength, with the lane change to a side done by a share.

    The front axle is further in the change by `reach`, and the rear one less far.
    """
    side = side_at(goal, share)
    fx, fy = lane_point(
        centre, distances, inner, outer, where + HALF_BASE, side_at(goal, share + reach)
    )
    rx, ry = lane_point(
        centre, distances, inner, outer, where - HALF_BASE, side_at(goal, share - reach)
    )
    x, y = lane_point(centre, distances, inner, outer, where, side)
    pose[X], pose[Y], pose[YAW], pose[SIDE] = x, y, np.arctan2(fy - ry, fx - rx), side


@kernel
def drive_bots_of_one(
    seconds: float, speed: float, change_length: float, centre: np.ndarray, distances: np.ndarray,
    inner: np.ndarray, outer: np.ndarray, along: np.ndarray, goals: np.ndarray,
    changed: np.ndarray, waits: np.ndarray, waiting: np.ndarray, n_changes: np.ndarray,
    paused: float, poses: np.ndarray,
) -> float:  # fmt: skip
    """Move the bots of one car; return how long they stand still yet, s. See `drive_bots`."""
    reach = HALF_BASE / change_length  # the front axle changes lanes earlier, the rear one later
    moving = max(seconds - paused, 0.0)
    for bot in range(along.shape[0]):
        step = speed * moving
        along[bot] = (along[bot] + step) % distances[-1]
        if changed[bot] < 1.0 + reach:
            changed[bot] += step / change_length
        else:
            waiting[bot] -= moving
            if waiting[bot] <= 0.0:
                goals[bot] = -goals[bot]
                changed[bot] = -reach
                n_changes[bot] += 1
                waiting[bot] = waits[bot, n_changes[bot] % waits.shape[1]]
        place_bot(
            centre, distances, inner, outer, along[bot], goals[bot], changed[bot], reach,
            poses[bot],
        )  # fmt: skip
    return max(paused - seconds, 0.0)


@kernel
def drive_bots(
    rows: np.ndarray, seconds: float, speed: float, change_length: float, centre: np.ndarray,
    distances: np.ndarray, inner: np.ndarray, outer: np.ndarray, along: np.ndarray,
    goals: np.ndarray, changed: np.ndarray, waits: np.ndarray, waiting: np.ndarray,
    n_changes: np.ndarray, paused: np.ndarray, poses: np.ndarray,
) -> None:  # fmt: skip
    """Move the bots of some cars, in place.

    Args:
        rows: which cars, (K,).
        seconds: for how long, s.
        speed: of all bots along the centre line, m/s.
        change_length: over which they change lanes, m.
        centre: of the road, (M, 2), with its arclengths and borders, (M,) and (M, 2), m.
        distances: see `centre`.
        inner: see `centre`.
        outer: see `centre`.
        along: see `Objects.along`, as for the other arrays.
        goals: the side that each bot has or goes to, (N, B).
        changed: share of the lane change that its middle has done, (N, B).
        waits: times between its changes, (N, B, W), s.
        waiting: what is left of that time, (N, B), s.
        n_changes: lane changes so far, (N, B).
        paused: how long the bots of a car stand still yet, (N,), s.
        poses: filled, (N, B, 4).
    """
    for row in rows:
        paused[row] = drive_bots_of_one(
            seconds, speed, change_length, centre, distances, inner, outer, along[row],
            goals[row], changed[row], waits[row], waiting[row], n_changes[row], paused[row],
            poses[row],
        )  # fmt: skip
