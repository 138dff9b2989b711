"""What a GPU runs to drive cars: a thread a car, which calls the kernels of the CPU.

There is no arithmetic of the simulator here. Every element is written by one thread, and nothing
is added up by several, so that two runs of a seed are equal. **N** cars, **B** bots or boxes, **E**
episodes drawn ahead, **K** of them new, two ways round a track.
"""

import math
from typing import Any

from numba import cuda, float64

from repaint_cli.envs.racer.dynamics.bots import HALF_BASE, SIDE, drive_bots_of_one
from repaint_cli.envs.racer.dynamics.car import SPEED, STEERING, STEP_SECONDS, YAW, drive
from repaint_cli.envs.racer.dynamics.encounters import AT_FAULT, HIT, NEXT, meet_one
from repaint_cli.envs.racer.dynamics.objects import PAUSE
from repaint_cli.envs.racer.dynamics.progress import count_one, progress_one
from repaint_cli.envs.racer.dynamics.rules import (
    IN_PROGRESS,
    TIME_UP,
    status_one,
    terms_one,
    traffic_terms_one,
)
from repaint_cli.envs.racer.track.geometry import (
    CENTRE_GAP,
    INNER_GAP,
    NDIST,
    OUTER_GAP,
    ROAD_WIDTH,
    WHEELS_ON,
    measure_one,
    nearest_of,
)
from repaint_cli.kernels import device_kernel

PARKED, DROVE, BEGAN = range(3)
"""What a car did in a step: nothing, it drove, or an episode began."""


@device_kernel
def choose_listed(actions: Any, choices: Any, commands: Any) -> None:
    """Look up actions (N,) among choices (A, 2); a number outside counts as the nearest one."""
    row = cuda.grid(1)
    if row < commands.shape[0]:
        choice = min(max(actions[row], 0), choices.shape[0] - 1)
        commands[row, 0], commands[row, 1] = choices[choice, 0], choices[choice, 1]


@device_kernel
def choose_ranged(actions: Any, low: Any, high: Any, commands: Any) -> None:
    """Turn actions (N, 2), clipped to −1 and 1, into commands from low (2,) to high (2,)."""
    row = cuda.grid(1)
    if row < commands.shape[0]:
        for k in range(2):
            share = (min(max(float64(actions[row, k]), -1.0), 1.0) + 1.0) / 2.0
            commands[row, k] = low[k] * (1.0 - share) + high[k] * share


@device_kernel
def put_starts(n: Any, drawn: Any, n_objects: Any, places: Any, table: Any) -> None:
    """Put n drawn episodes into the tables of places (E, N, 4) and objects (E, N, B, 2 + W).

    A row of `drawn` is the car, the slot, the place, and the objects one after the other.
    """
    k = cuda.grid(1)
    if k < n:
        row, slot = int(drawn[k, 0]), int(drawn[k, 1])
        for c in range(4):
            places[slot, row, c] = drawn[k, 2 + c]
        width = table.shape[3]
        for b in range(n_objects):
            for c in range(width):
                table[slot, row, b, c] = drawn[k, 6 + b * width + c]


@device_kernel
def drive_cars(
    parks: Any, places: Any, begun: Any, readings: Any, road: Any, ways: Any, car: Any,
    car_points: Any, status: Any, did: Any, commands: Any, before: Any, states: Any, fronts: Any,
    measures: Any, starts: Any, progress: Any, gained: Any, counters: Any,
) -> None:  # fmt: skip
    """Drive each car for a step, or begin its next episode, and measure where it is then."""
    row = cuda.grid(1)
    if row >= states.shape[0]:
        return
    state, previous, drives = states[row], 0.0, status[row] == IN_PROGRESS
    gained[row] = 0.0
    if not drives and parks:
        did[row] = PARKED
        return
    did[row] = DROVE if drives else BEGAN
    readings[row] += 1
    x, y = state[0], state[1]
    if drives:
        previous = progress[row]
        drive(state, before[row], commands[row], car, STEP_SECONDS)
        before[row, 0], before[row, 1] = commands[row, 0], commands[row, 1]
    else:
        place = places[begun[row] % places.shape[0], row]
        begun[row] += 1
        state[0], state[1], state[2] = place[0], place[1], place[2]
        state[3], state[4], starts[row] = 0.0, 0.0, place[3]
        before[row, 0], before[row, 1] = 0.0, 0.0
    room, way = cuda.local.array((5, 2), float64), ways[row]
    measure_one(
        state, car_points, road[0][way], road[1][way], road[2][way], road[3][way], road[4][way],
        road[5][way], room, fronts[row], measures[row],
    )  # fmt: skip
    progress[row] = progress_one(measures[row, NDIST], starts[row], previous)
    if drives:
        gained[row] = progress[row] - previous
        moved, count = math.hypot(state[0] - x, state[1] - y), counters[row]
        count[0], count[1], count[2] = count_one(moved, gained[row], count[0], count[1], count[2])
    else:
        counters[row, 0], counters[row, 1], counters[row, 2] = 0, 0, 0


@device_kernel
def drive_objects(
    speed: Any, change_length: Any, table: Any, begun: Any, road: Any, ways: Any, did: Any,
    along: Any, goals: Any, changed: Any, waits: Any, waiting: Any, n_changes: Any, paused: Any,
    poses: Any,
) -> None:  # fmt: skip
    """Move the objects of each car for a step, or put those of its next episode on the road."""
    row = cuda.grid(1)
    if row >= poses.shape[0] or did[row] == PARKED or (did[row] == DROVE and speed == 0.0):
        return
    seconds = STEP_SECONDS
    if did[row] == BEGAN:
        seconds, paused[row] = 0.0, 0.0
        drawn = table[(begun[row] - 1) % table.shape[0], row]
        for b in range(poses.shape[1]):
            along[row, b], goals[row, b] = drawn[b, 0], drawn[b, 1]
            for k in range(waits.shape[2]):
                waits[row, b, k] = drawn[b, 2 + k]
            waiting[row, b], n_changes[row, b] = waits[row, b, 0], 0
            changed[row, b] = 1.0 + HALF_BASE / change_length
    way = ways[row]
    paused[row] = drive_bots_of_one(
        seconds, speed, change_length, road[0][way], road[1][way], road[2][way], road[3][way],
        along[row], goals[row], changed[row], waits[row], waiting[row], n_changes[row],
        paused[row], poses[row],
    )  # fmt: skip


@device_kernel
def meet_objects(
    length: Any, any_crash: Any, own: Any, body: Any, lens: Any, did: Any, states: Any,
    measures: Any, poses: Any, along: Any, encounters: Any, paused: Any, crashed: Any,
) -> None:  # fmt: skip
    """Measure each car's encounters; bots pause where a crash is not its fault and ends nothing."""
    row = cuda.grid(1)
    if row >= poses.shape[0] or did[row] == PARKED:
        return
    corners, encounter = cuda.local.array((4, 2), float64), encounters[row]
    meet_one(
        states[row], measures[row, NDIST] * length, length, poses[row], along[row], own, body,
        lens, corners, encounter,
    )  # fmt: skip
    hit = encounter[HIT] > 0
    crashed[row] = hit and (any_crash or encounter[AT_FAULT] > 0)
    if hit and not crashed[row]:
        paused[row] = PAUSE


@device_kernel
def judge_cars(
    max_steps: Any, n_objects: Any, did: Any, measures: Any, progress: Any, gained: Any,
    counters: Any, crashed: Any, encounters: Any, poses: Any, status: Any, rewards: Any,
    terminations: Any, truncations: Any, terms: Any,
) -> None:  # fmt: skip
    """Fill how each car's step ended, and its reward terms (F, N); 0 where it did not drive."""
    row = cuda.grid(1)
    if row >= status.shape[0]:
        return
    terminations[row], truncations[row], rewards[row] = False, False, 0.0
    for k in range(terms.shape[0]):
        terms[k, row] = 0.0
    if did[row] != DROVE:
        if did[row] == BEGAN:
            status[row] = IN_PROGRESS
        return
    at, count = measures[row], counters[row]
    status[row] = status_one(
        at[WHEELS_ON], progress[row], crashed[row], count[0], count[1], count[2], max_steps
    )
    ended, is_late = status[row] != IN_PROGRESS, status[row] == TIME_UP
    terminations[row], truncations[row] = ended and not is_late, ended and is_late
    terms[0, row], terms[1, row], terms[2, row], terms[3, row] = terms_one(
        at[WHEELS_ON], at[CENTRE_GAP], at[INNER_GAP], at[OUTER_GAP], at[ROAD_WIDTH], gained[row],
        status[row],
    )  # fmt: skip
    rewards[row] = terms[2, row]
    if n_objects > 0:
        encounter = encounters[row]
        terms[4, row], terms[5, row], terms[6, row] = traffic_terms_one(
            encounter, poses[row, int(encounter[NEXT]), SIDE], terms[0, row]
        )


@device_kernel
def report_cars(
    length: Any, waypoints: Any, ways: Any, states: Any, fronts: Any, measures: Any,
    progress: Any, counters: Any, status: Any, report: Any,
) -> None:  # fmt: skip
    """Fill what is known of each car, (10, N), in the order of `names.RECORDS`."""
    row = cuda.grid(1)
    if row >= status.shape[0]:
        return
    report[0, row], report[1, row] = fronts[row, 0], fronts[row, 1]
    report[2, row], report[3, row] = states[row, YAW], states[row, SPEED]
    report[4, row], report[5, row] = states[row, STEERING], progress[row]
    report[6, row], report[7, row] = counters[row, 0] * STEP_SECONDS, measures[row, WHEELS_ON]
    report[8, row] = nearest_of(waypoints[ways[row]], measures[row, NDIST] * length)
    report[9, row] = status[row]
