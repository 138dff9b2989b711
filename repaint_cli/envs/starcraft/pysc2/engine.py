"""N games of the real StarCraft II, a process each, behind the interface of engines.

**N** games · **K** of them · **F** reward terms.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.engine import Flags, Rows
from repaint_cli.envs.starcraft.pysc2 import census, encoding
from repaint_cli.envs.starcraft.pysc2.checks import installed_game, map_file
from repaint_cli.envs.starcraft.pysc2.game import Game, Place
from repaint_cli.envs.starcraft.rts.constants import COMMANDS, SCREEN, TERMS
from repaint_cli.envs.starcraft.rts.engine import Observation
from repaint_cli.envs.starcraft.rts.maps import MapSpec


class RealEngine:
    """Plays N games one after the other: a step of all takes as long as N steps."""

    def __init__(
        self,
        spec: MapSpec,
        n: int,
        *,
        file: Path | None = None,
        version: str | None = None,
        one_process: bool = True,
    ) -> None:
        """Look whether the game and its map are there; `reset` starts the games.

        Args:
            spec: the mini-game: its name, camera, region and length; its rules are the map's.
            n: N.
            file: a user's map in place of the known one.
            version: of the game, such as "4.10"; None is the newest that is installed.
            one_process: whether a game's process plays all its episodes, of at most 14 minutes;
                else each episode has a new process, which takes its seed.

        Raises:
            GameError: PySC2, the game or the map is not installed.
        """
        installed = installed_game(version)
        path = map_file(installed, spec.name, file)
        place = Place(installed, spec, path, version, one_process)
        self.spec = spec
        self._games = [Game(place, i) for i in range(n)]
        self._playable = np.ones((n, SCREEN, SCREEN), np.bool_)

    def reset(self, seeds: NDArray[np.int64], rows: Rows | None = None) -> None:
        """Begin new episodes; see `Engine.reset`. A running process goes on with its own seed.

        Raises:
            GameError: the game does not start.
        """
        for seed, row in zip(seeds.tolist(), self._rows(rows), strict=True):
            game = self._games[row]
            game.reset(seed)
            self._playable[row] = encoding.playable_pixels(
                self.spec.region, census.camera(game.observation), self.spec.camera.width
            )

    def step(
        self, actions: NDArray[np.int16], playing: Flags | None = None
    ) -> tuple[NDArray[np.float32], Flags, Flags]:
        """Give every game a command and let it go on; see `Engine.step`.

        Raises:
            ValueError: an action is not of the action space.
            GameError: a game was lost several times in a row.
        """
        n = len(self._games)
        if np.shape(actions) != (n, 3):
            raise ValueError(f"expected actions ({n}, 3), found {np.shape(actions)}")
        outside = (actions < 0) | (actions >= (len(COMMANDS), SCREEN, SCREEN))
        if outside.any():
            raise ValueError(
                f"expected commands below {len(COMMANDS)} and pixels below {SCREEN}, found "
                f"{actions[outside.any(1)][0].tolist()}"
            )
        terms = np.zeros((n, len(TERMS)), np.float32)
        terminated, truncated = np.zeros((2, n), np.bool_)
        for row in range(n) if playing is None else np.flatnonzero(playing):
            command, x, y = map(int, actions[row])
            terms[row], terminated[row], truncated[row] = self._games[row].step(command, x, y)
        return terms, terminated, truncated

    def observe(self, rows: Rows | None = None, out: Observation | None = None) -> Observation:
        """Return what is seen; see `Engine.observe`."""
        chosen = self._rows(rows)
        observation = out or Observation.empty(len(chosen))
        for i, row in enumerate(chosen):
            game = self._games[row]
            observation.screen[i] = encoding.screen(game.observation, self._playable[row])
            observation.minimap[i] = encoding.minimap(game.observation)
            observation.measurements[i] = encoding.measurements(game.observation)
            observation.available[i] = game.available
        return observation

    def stats(self) -> dict[str, NDArray[np.int64]]:
        """Return numbers of the episodes so far; see `Engine.stats`."""
        return {
            "loop": np.array([game.loops for game in self._games], np.int64),
            "minerals_mined": np.array([game.minerals_mined for game in self._games], np.int64),
        }

    def close(self) -> None:
        """End the games' processes."""
        for game in self._games:
            game.close()

    def _rows(self, rows: Rows | None) -> list[int]:
        return list(range(len(self._games))) if rows is None else rows.tolist()
