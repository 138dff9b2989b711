"""N games of one map, behind Gymnasium's vector interface.

**N** environments · **F** reward terms · **C** commands.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from repaint_cli.envs.compound_space import CompoundSpace
from repaint_cli.envs.seeds import seeds_of
from repaint_cli.envs.starcraft.arguments import checked_actions
from repaint_cli.envs.starcraft.engine import Engine
from repaint_cli.envs.starcraft.layers import MINIMAP_LAYERS, SCREEN_LAYERS, Spread
from repaint_cli.envs.starcraft.names import WITH_A_POINT
from repaint_cli.envs.starcraft.reports import Reports, scaled
from repaint_cli.envs.starcraft.rts.constants import COMMANDS, MEASUREMENTS, SCREEN, TERMS

Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
Infos = dict[str, Any]


def action_space() -> CompoundSpace:
    """Return the actions: a command, and the column and row of a pixel, which some use."""
    uses = [(command in WITH_A_POINT,) * 2 for command in range(len(COMMANDS))]
    return CompoundSpace((len(COMMANDS), SCREEN, SCREEN), uses)


def observation_space(layers: str = "terran") -> Dict:
    """Return what is observed: two pictures, whose names say what layers they have, two vectors."""
    screen, minimap = picture_names(layers)
    return Dict(
        {
            screen: Box(0, 255, (SCREEN, SCREEN, len(SCREEN_LAYERS[layers])), np.uint8),
            minimap: Box(0, 255, (SCREEN, SCREEN, len(MINIMAP_LAYERS[layers])), np.uint8),
            "measurements": Box(0.0, np.inf, (len(MEASUREMENTS),), np.float32),
            "available": Box(0.0, 1.0, (len(COMMANDS),), np.float32),
        }
    )


def picture_names(layers: str) -> tuple[str, str]:
    """Return the names of the two pictures: a policy of other layers has others, and is refused."""
    return (
        ("screen", "minimap") if layers == "terran" else (f"screen-{layers}", f"minimap-{layers}")
    )


class StarCraftVectorEnv(VectorEnv[Any, NDArray[np.int64], Any]):
    """Build, train, select and attack: seven commands, two a second, one game an environment.

    **Observation** Dict of `screen`, (84, 84, 9) uint8, and `minimap`, (84, 84, 3) uint8, whose
    layers `layers.py` names and spreads over 0 to 255; `measurements`, (5,) float32: minerals, food
    used, food there is, SCVs, marines, each scaled to about 0 to 1; and `available`, (7,) float32:
    1 where a command can be carried out.

    **Actions** CompoundSpace(7, 84, 84): a command of `constants.COMMANDS`, and the column and the
    row of a pixel on the screen, which count for commands that need a point.

    **Reward** the sum of all terms, unweighed; tasks weigh the terms in the infos.

    **End** of the map's time, which truncates; in `find-and-defeat-zerglings` also with the last
    marine, which terminates.

    **Infos** arrays (N,) float64, the same keys at every step: the reward terms `constants.TERMS`,
    counts of this step, and the records `names.RECORDS`.

    **Autoreset** NEXT_STEP starts a new episode in the step after the last, ignoring that action.
    DISABLED stops the game: it shows its last pictures, earns nothing and costs nothing.
    """

    def __init__(
        self,
        engine: Engine,
        num_envs: int,
        *,
        layers: str = "terran",
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        """Play N games with an engine of N games; `reset` begins them.

        Args:
            engine: that plays.
            num_envs: N.
            layers: which layers are shown, a name in `layers.SCREEN_LAYERS`.
            autoreset_mode: NEXT_STEP or DISABLED.

        Raises:
            ValueError: an argument is out of range.
        """
        if autoreset_mode not in (AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED):
            raise ValueError(f"expected autoreset NEXT_STEP or DISABLED, found {autoreset_mode}")
        self.metadata = {"autoreset_mode": autoreset_mode, "render_fps": 8}
        self._stops = autoreset_mode is AutoresetMode.DISABLED
        self.num_envs, self._engine = num_envs, engine
        self._screen, self._minimap = (
            Spread(kinds[layers]) for kinds in (SCREEN_LAYERS, MINIMAP_LAYERS)
        )
        self._names = picture_names(layers)
        self.single_observation_space = observation_space(layers)
        self.single_action_space = action_space()
        self._sizes = action_space().nvec
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._observed: Any = None
        self._ended = np.zeros(num_envs, np.bool_)
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]
        self._reports = Reports(num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, Infos]:
        """Begin an episode in every environment.

        Args:
            seed: one an environment, of its first episode and of the generator that draws the seeds
                of the next ones; an integer s stands for s, s + 1, …; None goes on with the
                generators as they are.
            options: none are known.

        Raises:
            ValueError: the seeds are not N.
        """
        first = np.zeros(self.num_envs, np.int64)
        for i, one in enumerate(seeds_of(seed, self.num_envs)):
            if one is not None:
                self._rngs[i] = np.random.default_rng(one)
            first[i] = self._draw(i) if one is None else one
        rows = np.arange(self.num_envs)
        self._begin(rows, first)
        self._observed = self._engine.observe(None, self._observed)
        return self._observation(), self._infos(np.zeros((self.num_envs, len(TERMS))))

    def step(self, actions: NDArray[np.int64]) -> tuple[Any, Floats, Flags, Flags, Infos]:
        """Give every game a command and let it go on for half a second.

        Args:
            actions: command, column and row, (N, 3); ignored for games that are over.

        Returns:
            observations, rewards (N,), terminations (N,), truncations (N,), infos; all of them new
            arrays.

        Raises:
            ResetNeeded: the environment was never reset.
            ValueError: the actions are not N of the action space.
        """
        if self._observed is None:
            raise ResetNeeded("expected reset() before the first step()")
        chosen = checked_actions(actions, self.num_envs, self._sizes)
        moving, ended = ~self._ended, np.flatnonzero(self._ended)
        counts, terminated, truncated = self._engine.step(chosen, moving)
        terminated, truncated = terminated & moving, truncated & moving
        terms = np.where(moving[:, None], counts, 0.0).astype(np.float64)
        self._reports.passed(moving)
        if not self._stops:
            self._begin(ended, np.array([self._draw(int(row)) for row in ended], np.int64))
        self._ended |= terminated | truncated
        self._observed = self._engine.observe(None, self._observed)
        return (
            self._observation(), terms.sum(1), terminated, truncated, self._infos(terms),
        )  # fmt: skip

    def close_extras(self, **kwargs: Any) -> None:
        """End the games."""
        self._engine.close()

    def _draw(self, row: int) -> int:
        """Draw the seed of an environment's next episode."""
        return int(self._rngs[row].integers(2**31))

    def _begin(self, rows: Rows, seeds: Rows) -> None:
        """Begin new episodes of these environments (K,)."""
        if len(rows):
            self._engine.reset(seeds, rows)
            self._reports.begin(rows)
        self._ended[rows] = False

    def _observation(self) -> dict[str, np.ndarray]:
        """Return what is seen, as new arrays."""
        return {
            self._names[0]: self._screen(self._observed.screen),
            self._names[1]: self._minimap(self._observed.minimap),
            "measurements": scaled(self._observed.measurements),
            "available": self._observed.available.astype(np.float32),
        }

    def _infos(self, terms: Floats) -> Infos:
        """Return terms (N, F) and records by name."""
        mined = self._engine.stats()["minerals_mined"]
        return self._reports(terms, self._observed.measurements, mined)
