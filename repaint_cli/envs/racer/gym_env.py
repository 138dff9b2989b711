"""The racer as an environment of Gymnasium for other libraries: one car, or many in step."""

from collections.abc import Mapping, Sequence
from typing import Any, get_args

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from repaint_cli.envs.racer.arguments import check_names
from repaint_cli.envs.racer.dynamics.car import STEP_SECONDS
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.names import OBJECT_TERMS, TERMS
from repaint_cli.envs.racer.registration import MAX_EPISODE_STEPS
from repaint_cli.envs.racer.track.files import Waypoints, load_track
from repaint_cli.envs.reward_terms import RewardTerms

NO_LIMIT = 2**31 - 1
"""Steps: `gymnasium.make` puts a time limit around the environment."""


def make_cars(
    num_envs: int = 1,
    *,
    track: str | Sequence[str] = "reinvent-like",
    waypoints: Waypoints = "file",
    reward: Mapping[str, float] | None = None,
    max_episode_steps: int = MAX_EPISODE_STEPS,
    n_bots: int = 0,
    n_boxes: int = 0,
    objects: ObjectSettings | None = None,
    **settings: Any,
) -> "VectorEnv[Any, Any, Any]":
    """Make N cars, each on its own copy of a track; see `RacerVectorEnv`.

    Args:
        num_envs: N.
        track: a shipped track by name, or a file of waypoints; or several of them.
        waypoints: numbered as in its "file", or "unique": without rows that repeat another.
        reward: weights of reward terms, by name; the progress of the step where absent.
        max_episode_steps: the time limit, steps of 1/15 s.
        n_bots: other cars on each track.
        n_boxes: boxes on each track, where there are no other cars.
        objects: either of them with all their settings.
        settings: further arguments of `RacerVectorEnv`.

    Raises:
        ValueError: an argument is out of range, or there is no such reward term.
        RepaintError: there is no such track.
    """
    if sum(map(bool, (n_bots, n_boxes, objects))) > 1:
        raise ValueError("expected one of n_bots, n_boxes and objects, found more")
    objects = objects or ObjectSettings(n_bots or n_boxes, boxes=n_boxes > 0)
    terms = TERMS | OBJECT_TERMS if objects.n else TERMS
    for name in reward or ():
        check_names(reward=(name, sorted(terms)))
    check_names(waypoints=(waypoints, get_args(Waypoints)))
    names = (track,) if isinstance(track, str) else track
    roads = [load_track(name, waypoints) for name in names]
    cars = RacerVectorEnv(roads, num_envs, max_steps=max_episode_steps, objects=objects, **settings)
    return RewardTerms(cars, reward) if reward else cars


class RacerEnv(gymnasium.Env[Any, Any]):
    """One car; spaces, reward, starts and infos are those of `RacerVectorEnv`, without its axis N.

    The options of `reset` are `lap_fraction` and `track`, numbers, and `reverse`. It is drawn as
    its (left) camera sees the road.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as Gymnasium declares it
        "render_modes": ["rgb_array"],
        "render_fps": round(1 / STEP_SECONDS),
    }

    def __init__(self, render_mode: str | None = None, **settings: Any) -> None:
        """Build the car; `reset` puts it on the road.

        Args:
            render_mode: "rgb_array" or None.
            settings: arguments of `make_cars`.

        Raises:
            ValueError: an argument is out of range.
        """
        self._cars = make_cars(
            1, max_episode_steps=NO_LIMIT, autoreset_mode=AutoresetMode.DISABLED, **settings
        )
        self.render_mode = render_mode
        self.observation_space = self._cars.single_observation_space
        self.action_space = self._cars.single_action_space
        self._picture = np.zeros((*self._camera_shape()[:2], 3), np.uint8)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode; see `RacerVectorEnv.reset`."""
        super().reset(seed=seed)
        places = {name: [value] for name, value in (options or {}).items()}
        obs, infos = self._cars.reset(seed=seed, options=places)
        return self._look(obs), _of_one(infos)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for 1/15 s."""
        obs, rewards, terminations, truncations, infos = self._cars.step(np.array([action]))
        ends = bool(terminations[0]), bool(truncations[0])
        return self._look(obs), float(rewards[0]), *ends, _of_one(infos)

    def render(self) -> NDArray[np.uint8] | None:
        """Return what the (left) camera sees, (H, W, 3)."""
        return self._picture.copy() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Stop the sensors' threads."""
        self._cars.close()

    def _camera_shape(self) -> tuple[int, ...]:
        space = self.observation_space
        if isinstance(space, gymnasium.spaces.Dict):
            space = space["camera"]
        return space.shape or ()

    def _look(self, obs: Any) -> Any:
        """Return the one observation of N = 1, and keep its picture."""
        one = {name: part[0] for name, part in obs.items()} if isinstance(obs, dict) else obs[0]
        camera = one["camera"] if isinstance(one, dict) else one
        self._picture = np.repeat(camera[..., :1], 3, axis=-1)
        return one


def _of_one(infos: dict[str, Any]) -> dict[str, Any]:
    """Return the infos of N = 1 car: numbers, and arrays without the axis N."""
    return {name: rows[0].item() if rows.ndim == 1 else rows[0] for name, rows in infos.items()}
