"""Any environment of Gymnasium, by its id, as a simulator."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, field_validator

from repaint_cli.envs.simulator import Simulator
from repaint_cli.errors import CardError
from repaint_cli.settings import EvalConfig

if TYPE_CHECKING:
    from repaint_cli.envs.episodes import Episodes
    from repaint_cli.envs.gymnasium.paths import ReacherPaths
    from repaint_cli.envs.simulator import Environments

REACHER = "Reacher-v5"
"""The environment whose fingertip's paths are drawn."""

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
    kwargs: dict[str, bool | int | float | str] = Field(default_factory=dict)
    """Arguments for the environment."""

    @field_validator("kwargs")
    @classmethod
    def _of_the_environment(cls, kwargs: dict[str, Any]) -> dict[str, Any]:
        """Refuse what Gymnasium itself would take: windows, other time limits, wrappers."""
        for name in ("render_mode", "max_episode_steps", "num_envs", "disable_env_checker"):
            if name in kwargs:
                raise ValueError(f"expected arguments of the environment itself, found {name}")
        skip = kwargs.get("frame_skip", 1)
        if not isinstance(skip, int) or not 0 < skip <= LONGEST_STEP:
            raise ValueError(
                f"expected a frame_skip from 1 to {LONGEST_STEP:,}, whole, found {skip!r}"
            )
        return kwargs

    def make(self, n_envs: int, one_episode: bool, noise: EvalConfig | None) -> "Environments":
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
        import gymnasium

        module, _, name = self.id.rpartition(":")  # where it is registered, and its name
        try:
            if module:
                import_module(module)
            limit = gymnasium.spec(name).max_episode_steps
        except (gymnasium.error.Error, ImportError) as error:
            raise CardError(f"gymnasium has no environment '{self.id}': {error}") from error
        if limit is None:
            raise CardError(
                f"'{self.id}' has no time limit, so an evaluation might never end; "
                "register it with max_episode_steps"
            )
        return limit

    def same_world(self, other: Simulator) -> bool:
        """Return whether both are the same environment: only its infos show its terms."""
        return isinstance(other, GymnasiumSimulator) and self.id == other.id

    def code_at_risk(self) -> str | None:
        """Return the module that is imported, or a file that the environment reads."""
        if ":" in self.id:
            return f"the module of {self.id}"
        for name, value in self.kwargs.items():
            if isinstance(value, str) and ("/" in value or "\\" in value or "." in value):
                return f"the file {value} ({name})"
        return None

    @property
    def place(self) -> str:
        """The environment."""
        return self.id

    @property
    def paths(self) -> "ReacherPaths | None":
        """Those of Reacher's fingertip."""
        from repaint_cli.envs.gymnasium.paths import ReacherPaths

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
