"""The interface of a simulator: everything that a command needs of one.

A card's [env] section is a simulator with its settings. A new one subclasses `Simulator` and has a
line in `registry.REGISTRY`. **S** seeds · **N** environments, **E** episodes a seed.
"""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from repaint_cli.envs.checked_file import CheckedFile
from repaint_cli.errors import CardError, RenderError
from repaint_cli.settings import EvalConfig, Settings
from repaint_cli.symmetry import Symmetry

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv

    from repaint_cli.envs.episodes import Column, Episodes, Parts
    from repaint_cli.envs.logs import LogFormat
    from repaint_cli.envs.paths import PathFormat
    from repaint_cli.envs.reward_functions import RewardFunctions

    Environments = VectorEnv[Any, Any, Any]


class Simulator(Settings, ABC):
    """A simulator with its settings; what a subclass does not define has a default here."""

    simulator: str
    """Which simulator this is, a name in `REGISTRY`."""

    # Environments

    has_noise: ClassVar[bool] = False
    """Whether `eval.noise` disturbs observations and actions."""

    @abstractmethod
    def make(
        self, n_envs: int, one_episode: bool, noise: EvalConfig | None, training: bool = False
    ) -> "Environments":
        """Make N copies that step together, with next-step autoreset; see `Task.make_env`.

        Args:
            n_envs: N.
            one_episode: whether environments may stop for good after their first episode.
            noise: amplitudes of noise, where it is asked for; in training those of [eval].
            training: whether they are for training, which may be noisy or not whatever these say.

        Raises:
            CardError: the environment cannot be made.
        """

    def make_replayable(self, n_envs: int) -> "Environments | None":
        """Make N copies whose episodes can be played again, as resuming within one asks for.

        Each copy's attribute `begun`, set to a `BegunEpisode`, is played by its next reset; see
        `gymnasium/replay.py`. None where that is not possible: episodes then begin afresh.
        """
        return None

    @abstractmethod
    def longest_episode(self) -> int:
        """Return the time limit, in steps.

        Raises:
            CardError: the environment does not exist or has no limit.
        """

    def gpu_simulator(self) -> "Simulator | None":
        """Return it as it trains on a GPU, or None where it, or one of its settings, cannot."""
        return None

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None, both_directions: bool
    ) -> dict[str, Any] | None:
        """Return where S × N episodes start, for `reset`; None where the environment decides.

        Where not None, "parked" may be added: which environments will not be stepped, (S · N,).

        Args:
            n_seeds: S.
            n_envs: N.
            iteration: of training; None is an evaluation, whose starts are spread evenly.
            both_directions: whether every other evaluated episode goes the other way.
        """
        return None

    def even_episodes(self, n: int) -> int:
        """Return n, or the next number of episodes that are as many on each of its `parts`."""
        return n

    @property
    def records(self) -> tuple[str, ...]:
        """What of the infos of a step is worth keeping, by name.

        Three names mean the same everywhere, and curves, tables and metrics use them: `progress`
        (% of the way), `lap_time` (s) and `status` (a number, how the episode ended).
        """
        return ()

    def notes(self) -> list[str]:
        """Return what is worth knowing of its files before a run begins, a sentence each."""
        return []

    def doubts(self) -> list[str]:
        """Return what in its settings can hardly be meant, a sentence each."""
        return []

    # The task

    @property
    def choices(self) -> tuple[Any, ...] | None:
        """What policies choose among, where equal action spaces may mean other things."""
        return None

    @property
    def reward_terms(self) -> frozenset[str] | None:
        """All terms that it can pay, by name; None where only a running environment shows them."""
        return None

    @property
    def platform(self) -> str | None:
        """Which of the paper's platforms it is, a name in `tasks.paper.PAPER`, or None."""
        return None

    def same_world(self, other: "Simulator") -> bool:
        """Return whether the reward terms of both mean the same, so that weights compare."""
        if self.reward_terms is None or other.reward_terms is None:
            return self == other
        return type(self) is type(other) and self.reward_terms == other.reward_terms

    def settled(self) -> Self:
        """Return the settings with the values of those that follow from others where absent."""
        return self

    takes_symmetry: ClassVar[bool] = True
    """Whether a card may name a symmetry, as `symmetries` need not know all."""

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Return the known reflections of observations, actions and terms."""
        return ()

    def why_no_symmetry(self) -> str | None:
        """Return why `symmetries` is empty, for people; None where it is not."""
        none = f"no symmetry of the simulator '{self.simulator}' is known; a card can name one in"
        return None if self.symmetries() else f"{none} its section [symmetry]"

    # Files and code that a card brings along

    @classmethod
    def resolve_files(cls, env: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Return a card's [env] with what its files stand for; CardError: one cannot be read."""
        return env

    def files(self) -> dict[str, Path]:
        """Return the user's files that it reads, by setting: a run goes on only with the same."""
        return {}

    def code_at_risk(self) -> str | None:
        """Return what user code would run or user file be read, for people, or None."""
        return None

    @property
    def reward_functions(self) -> "RewardFunctions | None":
        """A user's own reward functions as the reward, or None where it takes none."""
        return None

    @classmethod
    def check_file(cls, name: str) -> "CheckedFile | None":
        """Check a file that is no card, if it is of a kind that this simulator reads.

        Raises:
            NotFound, CardError: the file does not exist, or is damaged.
        """
        return None

    def beside(self, engine: str) -> list[str]:
        """Play a fixed script in its own engine and in another; return both timelines, for people.

        Raises:
            CardError: it has one engine only, or not this one.
        """
        raise CardError(f"expected a task that has several engines, found '{self.simulator}'")

    # How episodes went

    @property
    def score_episodes(self) -> int:
        """Episodes in a teacher's score."""
        return 100

    def columns(self, episodes: "Episodes", s: int) -> "list[Column]":
        """Return the columns of a table of the episodes of seed s, beside their return."""
        from repaint_cli.envs.episodes import Column

        return [Column("length", episodes.lengths[s], "mean")]

    def parts(self, episodes: "Episodes", s: int) -> "Parts | None":
        """Return the episodes of seed s by what they were played on; None where all are alike."""
        return None

    def outcomes(self, episodes: "Episodes") -> dict[str, Any]:
        """Return the outcomes of episodes, beside returns and lengths, as JSON."""
        return {}

    def racing(self, config: EvalConfig) -> "Simulator":
        """Return the simulator whose evaluated episodes are races under the rules in [eval].

        Raises:
            CardError: it has no races.
        """
        raise CardError("expected --race with a racing task; leave it out")

    # Paths, films, logs

    @property
    def place(self) -> str:
        """What two tasks share whose paths can be drawn side by side, for people."""
        return self.simulator

    @property
    def paths(self) -> "PathFormat | None":
        """How its episodes' paths are found and drawn, or None where they lead along none."""
        return None

    filmed_episodes: ClassVar[int] = 5
    """Episodes in a film, or a few more, where nothing else is asked for."""
    films_observations: ClassVar[bool] = False
    """Whether a film shows what the policy observed."""

    def for_replay(self) -> "Simulator":
        """Return the settings whose episodes can be played again, for a film."""
        return self

    def film(self, episodes: "Episodes", path: Path, title: str, n_episodes: int) -> None:
        """Film the first seed's first episodes.

        Raises:
            RenderError, StoreError: nothing can be drawn here, or the file cannot be written.
        """
        raise RenderError(f"the simulator '{self.simulator}' has no films")

    @property
    def logs(self) -> "LogFormat | None":
        """Its own format of logs, or None."""
        return None
