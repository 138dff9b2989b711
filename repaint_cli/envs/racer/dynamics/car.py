"""The car: its points, its actions, and its response to commands. SI units.

The dynamics are a bicycle with lag and a saturating curvature, a few constants a profile, fitted to
logs of the real DeepRacer simulator. An ideal bicycle with the same wheelbase misses that simulator
four to ten times as far.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.actions import SPEED_LIMITS, STEERING_LIMIT
from repaint_cli.kernels import kernel

STEP_SECONDS = 1 / 15
"""One step is one camera frame."""
SUBSTEPS = 8
FRONT_OFFSET = 0.14
"""From the base, midway between the axles, to the front point, whose position is the car's, m."""
WHEELS = np.array(
    [[-0.081663, 0.08105], [-0.081663, -0.08105], [0.082311, 0.079601], [0.082311, -0.079601]]
)
"""Wheel points in the car's frame (x ahead, y left of the base), (4, 2), m."""
WHEELS.flags.writeable = False
REAR_AXLE = 0.0817
"""From the rear axle, which does not slip sideways, to the base, m."""
CAR_POINTS = np.vstack([[FRONT_OFFSET, 0.0], WHEELS])
"""Front point and wheel points in the car's frame, (5, 2), m."""
CAR_POINTS.flags.writeable = False
ACTIONS = tuple((angle, speed) for speed in (0.5, 1.0) for angle in (-30.0, -15.0, 0.0, 15.0, 30.0))
"""Steering (degrees, positive to the left) and speed (m/s) to choose from, by default."""


def commands_of(actions: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
    """Return actions in degrees and m/s as commands within the car's limits, (A, 2) rad and m/s."""
    angle, speed = np.array(actions, dtype=np.float64).T
    steering = np.deg2rad(np.clip(angle, -STEERING_LIMIT, STEERING_LIMIT))
    return np.stack([steering, np.clip(speed, *SPEED_LIMITS)], axis=1)


X, Y, YAW, SPEED, STEERING = range(5)
"""Columns of a state: base position (m), heading (rad), true speed (m/s) and steering (rad)."""


@dataclass(frozen=True)
class CarProfile:
    """A car's response to its commands."""

    speed_lag: float
    """Time constant of the speed, s; 0 is immediate."""
    acceleration_limit: float
    """Largest acceleration and braking, m/s²."""
    steering_lag: float
    """Time constant of the steering angle, s; 0 is immediate."""
    wheelbase: float
    """Effective wheelbase, m; longer than the real 0.164 m since the tyres slip."""
    curvature_limit: float
    """Curvature that no steering angle exceeds, 1/m."""
    delay: float
    """From the start of a step until its command takes effect, s."""

    def constants(self) -> NDArray[np.float64]:
        """Return the fields in their order, as the kernels read them, (6,)."""
        return np.array(astuple(self))


CAR_PROFILES = {
    "sim4": CarProfile(0.182, 3.55, 0.444, 0.227, 1.84, 0.021),
    "sim5": CarProfile(0.031, 10.3, 0.170, 0.231, 1.97, 0.020),
    "ideal": CarProfile(0.0, np.inf, 0.0, 0.164, np.inf, 0.0),
}
"""sim4: the simulator of 2021-22. sim5: that of 2026. ideal: a bicycle without lag."""


@kernel
def drive(
    state: np.ndarray, before: np.ndarray, command: np.ndarray, car: np.ndarray, seconds: float
) -> None:
    """Advance one car, in place.

        v̇ = clip((u − v)/τ_v, ±a_max)      δ̇ = (δ_cmd − δ)/τ_δ
        κ = κ_max·tanh(tan δ / (L·κ_max))   ψ̇ = v·κ
        ẋ = v·(cos ψ − l_r·κ·sin ψ)         ẏ = v·(sin ψ + l_r·κ·cos ψ)

    The state is X, Y, YAW, SPEED, STEERING, (5,). A command is δ_cmd and u, (2,); the previous one
    is in force until the delay is over. The car is `CarProfile.constants()`, (6,); seconds in s.
    """
    speed_lag, acceleration_limit, steering_lag = car[0], car[1], car[2]
    wheelbase, curvature_limit, delay = car[3], car[4], car[5]
    h = seconds / SUBSTEPS
    x, y, yaw, speed, steering = state[0], state[1], state[2], state[3], state[4]
    for i in range(SUBSTEPS):
        old = min(max(delay / h - i, 0.0), 1.0)  # share of this substep before the new command
        wanted_steering = old * before[0] + (1.0 - old) * command[0]
        wanted_speed = old * before[1] + (1.0 - old) * command[1]
        if speed_lag > 0.0:
            push = (wanted_speed - speed) / speed_lag
            speed += h * min(max(push, -acceleration_limit), acceleration_limit)
        else:
            speed = wanted_speed
        if steering_lag > 0.0:
            steering += h * (wanted_steering - steering) / steering_lag
        else:
            steering = wanted_steering
        curvature = np.tan(steering) / wheelbase
        if curvature_limit < np.inf:
            curvature = curvature_limit * np.tanh(curvature / curvature_limit)
        slip = REAR_AXLE * curvature
        x += h * speed * (np.cos(yaw) - slip * np.sin(yaw))
        y += h * speed * (np.sin(yaw) + slip * np.cos(yaw))
        yaw += h * speed * curvature
    state[0], state[1], state[3], state[4] = x, y, speed, steering
    state[2] = np.arctan2(np.sin(yaw), np.cos(yaw))


@kernel
def drive_rows(
    rows: np.ndarray,
    states: np.ndarray,
    before: np.ndarray,
    commands: np.ndarray,
    car: np.ndarray,
    seconds: float,
) -> None:
    """Advance some cars by one step, in place; `rows` (K,) are row numbers of the other arrays."""
    for row in rows:
        drive(states[row], before[row], commands[row], car, seconds)
