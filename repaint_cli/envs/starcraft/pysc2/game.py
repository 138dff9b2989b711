"""One process of the game, and the episode that it plays."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli import activity
from repaint_cli.envs.output import warn
from repaint_cli.envs.starcraft.pysc2 import commands
from repaint_cli.envs.starcraft.pysc2.census import Census, selected
from repaint_cli.envs.starcraft.pysc2.checks import launch_errors, misunderstood
from repaint_cli.envs.starcraft.pysc2.maps import longest
from repaint_cli.envs.starcraft.rts.constants import (
    BUILD_BARRACKS,
    BUILD_DEPOT,
    COMMANDS,
    LOOPS_PER_STEP,
    SCREEN,
    SELECT_POINT,
    SELF,
    TERMS,
)
from repaint_cli.envs.starcraft.rts.maps import MapSpec
from repaint_cli.errors import GameError

MOST_LOSSES = 3
"""Episodes in a row that may lose their game before it is an error."""

SUCCESS = 1
"""The game's result of an action that was carried out."""


@dataclass(frozen=True)
class Place:
    """What a game is played with."""

    installed: Any
    """PySC2's configuration of the installed game."""
    spec: MapSpec
    """The mini-game."""
    file: Path
    """Of its map, absolute."""
    version: str | None = None
    """Of the game; None is the newest."""
    one_process: bool = True
    """Whether a process plays all episodes; else each has a new one, which takes the seed."""

    @property
    def loops(self) -> int:
        """After which an episode is cut off."""
        return longest(self.spec, self.one_process)


class Game:
    """A game of the real StarCraft II."""

    def __init__(self, place: Place, number: int) -> None:
        """Take a place in which to play; `reset` starts the game. `number`, from 0, is its name."""
        self.observation: Any = None
        """PySC2's last observation."""
        self.available = np.zeros(len(COMMANDS), np.uint8)
        """Which commands can be carried out, (7,)."""
        self._place, self._name = place, f"game {number + 1}"
        self._env: Any = None
        self._played, self._losses, self._steps = 0, 0, 0

    def reset(self, seed: int) -> None:
        """Begin a new episode, in a new process where there is none or each has its own.

        Args:
            seed: of the process, where a new one starts.

        Raises:
            GameError: the game does not start.
        """
        if not self._place.one_process:
            self.close()
        with launch_errors(self._place.installed):
            try:
                step = self._first(seed)
            except _losses() as error:
                if not self._played:
                    raise
                self._lose(error, "between two episodes")
                step = self._first(seed)
        if self._place.spec.base and self._played and _idle_workers(step):
            warn("a mineral patch is missing after StarCraft II restarted the map; it starts anew")
            self.close()
            with launch_errors(self._place.installed):
                step = self._first(seed)
        self._played += 1
        self._steps = 0
        self._take(step)
        self._census = Census(self.observation)

    def _first(self, seed: int) -> Any:
        """Return the first time step of an episode."""
        if self._env is None:
            self._env, self._played = self._launch(seed), 0
        step = self._env.reset()[0]
        if self._place.spec.marines:  # selected, which the screen shows one action later
            step = self._env.step([commands.no_op()])[0]
        return step

    def _launch(self, seed: int) -> Any:
        from pysc2.env import sc2_env
        from pysc2.maps import lib

        game_map = lib.Map()
        game_map.filename, game_map.players, game_map.score_index = str(self._place.file), 1, 0
        interface = sc2_env.AgentInterfaceFormat(
            feature_dimensions=sc2_env.Dimensions(screen=SCREEN, minimap=SCREEN),
            camera_width_world_units=self._place.spec.camera.width,
            use_raw_units=True,  # for the tags of units, which its feature units do not have
            send_observation_proto=True,  # for where the camera is, and who died
        )
        with activity.doing("starting StarCraft II"):
            return sc2_env.SC2Env(
                map_name=game_map,
                players=[sc2_env.Agent(sc2_env.Race.terran)],
                agent_interface_format=interface,
                step_mul=LOOPS_PER_STEP,
                game_steps_per_episode=self._place.loops,
                random_seed=seed % 2**31,
                visualize=False,
                version=self._place.version,
            )

    def step(self, command: int, x: int, y: int) -> tuple[NDArray[np.float32], bool, bool]:
        """Give the game a command and let it go on.

        A game that is lost meanwhile truncates the episode; its last observation stays, and the
        next `reset` starts a new one.

        Args:
            command: which of `COMMANDS`.
            x: column of the pixel.
            y: row of the pixel.

        Returns:
            terms of this step (F,), whether the episode terminated, and whether it was truncated.

        Raises:
            GameError: the game was lost several times in a row, or is not understood.
        """
        can = bool(self.available[command])
        before = self.observation
        self._steps += 1
        try:
            step = self._env.step([commands.call(command, x, y) if can else commands.no_op()])[0]
        except _losses() as error:
            self._lose(error, f"at step {self._steps:,}")
            return np.zeros(len(TERMS), np.float32), False, True
        except (ValueError, LookupError) as error:
            raise GameError(misunderstood(error)) from error
        self._take(step)
        terms = self._census.count(self.observation)._asdict()
        failed = command in (BUILD_DEPOT, BUILD_BARRACKS) and _any_failure(self.observation)
        terms["unavailable"] = not can or failed
        if can and command == SELECT_POINT:
            hit = _hit(before, self.observation, x, y)
            terms["select_hit"], terms["select_miss"] = hit, not hit
        over = step.last()
        timed_out = over and self.loops + LOOPS_PER_STEP >= self._place.loops
        if over:
            self._losses = 0
        return _array(terms), over and not timed_out, timed_out

    @property
    def loops(self) -> int:
        """How far the episode is."""
        return int(self.observation["game_loop"][0])

    @property
    def minerals_mined(self) -> int:
        """Minerals that were brought home since the episode began."""
        return int(self.observation["score_cumulative"].collected_minerals)

    def close(self) -> None:
        """End the process."""
        env, self._env = self._env, None
        if env is not None:
            with suppress(Exception):  # of a process that is gone already
                env.close()

    def _take(self, step: Any) -> None:
        """Keep an observation."""
        self.observation = step.observation
        ids = np.asarray(self.observation["available_actions"])
        self.available = commands.availability(ids, self._place.spec.zerglings > 0)

    def _lose(self, error: Exception, when: str) -> None:
        """Say that the game is lost, and forget it.

        Raises:
            GameError: so were the games of several episodes before.
        """
        self.close()
        self._losses += 1
        why = " ".join(str(error).split())[:200]
        if self._losses >= MOST_LOSSES:
            raise GameError(
                f"StarCraft II was lost {self._losses} times in a row, last in {self._name} {when} "
                f"({why}); is there memory for as many games (ppo.n_episodes, eval.episodes)?"
            ) from error
        warn(
            f"StarCraft II was lost in {self._name} {when} ({why}); the episode is cut off there, "
            "and the next one starts the game anew"
        )


def _losses() -> tuple[type[Exception], ...]:
    """Return what PySC2 raises where the process is gone; of an empty observation RuntimeError."""
    import websocket
    from pysc2.lib import protocol, remote_controller

    return (
        protocol.ConnectionError, protocol.ProtocolError, remote_controller.RequestError,
        websocket.WebSocketException, RuntimeError,
    )  # fmt: skip


def _array(terms: dict[str, Any]) -> NDArray[np.float32]:
    return np.array([terms.get(name, 0) for name in TERMS], np.float32)


def _idle_workers(step: Any) -> int:
    return int(step.observation["player"].idle_worker_count)


def _any_failure(observation: Any) -> bool:
    """Return whether the game says that something was not carried out, such as a building."""
    return bool(np.any(np.asarray(observation["action_result"]) != SUCCESS))


def _hit(before: Any, after: Any, x: int, y: int) -> bool:
    """Return whether a click selected a unit of ours.

    Either the selection is another than before, or it is as before and the pixel showed a unit.
    """
    now = selected(after)
    if now != selected(before):
        return bool(now)
    return bool(now) and bool(before["feature_screen"].player_relative[y, x] == SELF)
