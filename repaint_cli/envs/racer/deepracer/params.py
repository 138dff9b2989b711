"""The argument of a DeepRacer reward function: the dictionary `params`, key by key as there."""

from bisect import bisect_right
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from repaint_cli.envs.racer.dynamics.bots import SIDE, YAW, X, Y
from repaint_cli.envs.racer.dynamics.car import STEP_SECONDS
from repaint_cli.envs.racer.dynamics.car import YAW as HEADING
from repaint_cli.envs.racer.dynamics.encounters import NEXT_SEEN
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.rules import CRASHED
from repaint_cli.envs.racer.track.geometry import (
    CENTRE_GAP,
    INNER_GAP,
    NDIST,
    OUTER_GAP,
    ROAD_WIDTH,
    WHEELS_ON,
    Floats,
)
from repaint_cli.envs.racer.track.track import Track


@dataclass(frozen=True)
class CarState:
    """One car after a step, with its objects."""

    road: Track
    """The track, in the direction that the car drives it."""
    is_reversed: bool
    """Whether that is the reverse direction."""
    front: Floats
    """The front point, (2,), m."""
    yaw: float
    """Heading, rad."""
    chosen: Floats
    """Steering (rad) and speed (m/s) of the action that was chosen, (2,)."""
    measures: Floats
    """`geometry.locate`'s answer, (6,)."""
    progress: float
    """Of the lap, %."""
    steps: int
    """Of the episode, from 1."""
    seconds: float
    """Of the episode, s."""
    crashed: bool
    """Whether it hit an object."""
    poses: Floats
    """Of its objects, (B, 4)."""
    objects_along: Floats
    """Their arclengths, (B,), m."""
    objects_speed: float
    """Of all of them, m/s: 0 of boxes."""
    encounter: Floats
    """`encounters.meet`'s answer, (6,)."""


def params_in(fleet: Fleet, row: int, chosen: Floats) -> dict[str, Any]:
    """Return the `params` of the current state of one of a fleet's cars.

    Args:
        fleet: of the car.
        row: which car.
        chosen: steering (rad) and speed (m/s) of the last step's action, (2,).
    """
    objects, steps = fleet.objects, int(fleet.counters.steps[row])
    return params_of(
        CarState(
            road=fleet.directions.road_of(row),
            is_reversed=bool(fleet.directions.reverse[row]),
            front=fleet.fronts[row],
            yaw=float(fleet.states[row, HEADING]),
            chosen=chosen,
            measures=fleet.measures[row],
            progress=float(fleet.progress[row]),
            steps=steps,
            seconds=steps * STEP_SECONDS,
            crashed=bool(fleet.status[row] == CRASHED),
            poses=objects.poses[row] if objects else np.empty((0, 4)),
            objects_along=objects.along[row] if objects else np.empty(0),
            objects_speed=objects.speed if objects else 0.0,
            encounter=fleet.encounters[row],
        )
    )


def params_of(car: CarState) -> dict[str, Any]:
    """Return all 27 keys; lengths in m, angles in degrees but for `objects_heading`, in radians."""
    road, m = car.road, car.measures
    along = float(m[NDIST]) * road.length
    inner_is_left = road.ccw
    wheels = int(m[WHEELS_ON])
    return {
        "all_wheels_on_track": wheels == 4,
        "x": float(car.front[0]),
        "y": float(car.front[1]),
        "heading": float(np.rad2deg(car.yaw)),
        "distance_from_center": float(m[CENTRE_GAP]),
        "projection_distance": along,
        "progress": float(car.progress),
        "steps": float(car.steps),
        "speed": float(car.chosen[1]),
        "steering_angle": round(float(np.rad2deg(car.chosen[0])), 9),  # 15.0, as listed
        "track_width": float(m[ROAD_WIDTH]),
        "track_length": road.length,
        "waypoints": list(_waypoints(road)),
        "closest_waypoints": closest_waypoints(road, along),
        "is_left_of_center": bool(m[INNER_GAP] < m[OUTER_GAP]) == inner_is_left,
        "is_reversed": car.is_reversed,
        "is_crashed": car.crashed,
        "is_offtrack": wheels == 0,
        "sim_time": car.seconds,
    } | _objects(car, along, inner_is_left)


def closest_waypoints(road: Track, along: float) -> list[int]:
    """Return the indices of the waypoints before and after an arclength, m."""
    places = _places(road)
    after = bisect_right(places, along)
    return [after - 1, after if after < len(places) else 0]


@lru_cache(maxsize=256)
def _waypoints(road: Track) -> tuple[tuple[float, float], ...]:
    return tuple((x, y) for x, y in road.waypoints[0].tolist())


@lru_cache(maxsize=256)
def _places(road: Track) -> tuple[float, ...]:
    return tuple(road.waypoints[1].tolist())


def _objects(car: CarState, along: float, inner_is_left: bool) -> dict[str, Any]:
    """Return the keys about objects, in the order in which they were placed."""
    poses, length = car.poses, car.road.length
    ahead = np.mod(car.objects_along - along, length)
    closest = [int(ahead.argmax()), int(ahead.argmin())] if len(poses) else [0, 0]
    places = car.road.pose_at(car.objects_along / length)[0] if len(poses) else np.empty((0, 2))
    gaps = np.hypot(poses[:, X] - places[:, 0], poses[:, Y] - places[:, 1])
    return {
        "closest_objects": closest,
        "objects_location": poses[:, [X, Y]].tolist(),
        "objects_left_of_center": [bool(side > 0) == inner_is_left for side in poses[:, SIDE]],
        "object_in_camera": len(poses) > 0 and bool(car.encounter[NEXT_SEEN]),
        "objects_speed": [car.objects_speed] * len(poses),
        "objects_heading": (poses[:, YAW] if car.objects_speed else np.zeros(len(poses))).tolist(),
        "objects_distance": car.objects_along.tolist(),
        "objects_distance_from_center": gaps.tolist(),
    }
