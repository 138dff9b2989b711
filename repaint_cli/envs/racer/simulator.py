"""Our racing simulator behind the interface of simulators."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from repaint_cli.envs.checked_file import CheckedFile
from repaint_cli.envs.racer.actions import ActionRanges
from repaint_cli.envs.racer.mirror import symmetries_of, unpaired_action
from repaint_cli.envs.racer.names import OBJECT_RECORDS, OBJECT_TERMS, RECORDS, TERMS, TRACK_RECORD
from repaint_cli.envs.racer.settings import RacerSettings
from repaint_cli.envs.racer.tracks import Starts, beside, files_of, labels_of
from repaint_cli.errors import CardError, RepaintError
from repaint_cli.settings import EvalConfig
from repaint_cli.symmetry import Symmetry

if TYPE_CHECKING:
    from repaint_cli.envs.episodes import Column, Episodes, Parts
    from repaint_cli.envs.logs import LogFormat
    from repaint_cli.envs.racer.dynamics.race import RaceRules
    from repaint_cli.envs.racer.paths import RacerPaths
    from repaint_cli.envs.reward_functions import RewardFunctions
    from repaint_cli.envs.simulator import Environments, Simulator


class RacerSimulator(RacerSettings):
    """Our racing simulator: a car with a camera on a track, alone or among bots or boxes."""

    # Environments

    has_noise: ClassVar[bool] = True
    device: ClassVar[str] = "cpu"
    """Where cars are; see `RacerVectorEnv`."""

    def make(
        self, n_envs: int, one_episode: bool, noise: EvalConfig | None, training: bool = False
    ) -> "Environments":
        """Make N cars; see `Simulator.make`."""
        from gymnasium.vector import AutoresetMode

        from repaint_cli.envs.racer.env import RacerVectorEnv
        from repaint_cli.envs.racer.sight.appearance import RandomAppearance
        from repaint_cli.envs.racer.sight.noise import Noise
        from repaint_cli.envs.racer.track.files import load_tracks

        appearance, noisy = None, self.training_noise or not training
        if training and (self.random_light or self.random_colours):
            appearance = RandomAppearance(self.random_light, self.random_colours)
        try:
            return RacerVectorEnv(
                load_tracks(self.tracks, self.waypoints), n_envs,
                car=self.car, actions=self.actions, sensors=self.sensors, objects=self.objects,
                crash=self.crash, range_min=self.range_min, max_steps=self.longest_episode(),
                noise=Noise.of(noise) if noise and noisy else None,
                appearance=appearance, race=self.race_rules(),
                autoreset_mode=AutoresetMode.DISABLED if one_episode else AutoresetMode.NEXT_STEP,
                device=self.device,
            )  # fmt: skip
        except ValueError as error:
            raise CardError(f"[env]: {error}") from error

    def gpu_simulator(self) -> "Simulator | None":
        """Return the racer as it trains on a GPU; see `Simulator.gpu_simulator`."""
        from repaint_cli.envs.racer.gpu_simulator import GpuRacer

        return GpuRacer.of(self)

    def race_rules(self) -> "RaceRules | None":
        """Return the rules of races where an episode is one."""
        return None

    def racing(self, config: EvalConfig) -> "Simulator":
        """Return the racer whose episodes are races; see `Simulator.racing`."""
        from repaint_cli.envs.racer.race_simulator import RaceSimulator

        return RaceSimulator.of(self, config)

    def longest_episode(self) -> int:
        """Return the time limit, in steps."""
        from repaint_cli.envs.racer.laps import time_limit

        return self.max_steps or time_limit(self.tracks, self.actions)

    def settled(self) -> Self:
        """Return the settings with the time limit that follows; see `Simulator.settled`."""
        if self.max_steps is not None:
            return self
        with suppress(RepaintError):  # the track's file is gone
            return self.model_copy(update={"max_steps": self.longest_episode()})
        return self

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None, both_directions: bool
    ) -> dict[str, Any] | None:
        """Return where S × N episodes start; see `Simulator.start_options` and `tracks.Starts`."""
        starts = Starts(len(self.tracks), self.start_offset, self.start_spacing)
        if iteration is None:
            options, turns = starts.evaluation(n_envs)
            by_turns = both_directions
        else:
            options, turns = starts.training(n_envs, iteration)
            by_turns = self.direction == "alternate"
        if by_turns or self.direction == "reverse":
            options["reverse"] = turns if by_turns else [True] * n_envs
        return {name: values * n_seeds for name, values in options.items()}

    def even_episodes(self, n: int) -> int:
        """Return so many episodes or a few more, as many on each track."""
        return -(-n // len(self.tracks)) * len(self.tracks)

    @property
    def records(self) -> tuple[str, ...]:
        """What of the infos of a step is worth keeping, by name."""
        several = (TRACK_RECORD,) * (len(self.tracks) > 1)
        return (*RECORDS, *OBJECT_RECORDS * (self.objects.n > 0), *several)

    def notes(self) -> list[str]:
        """Return what was mended in the tracks' files; see `Simulator.notes`."""
        from repaint_cli.envs.racer.laps import notes_on

        return notes_on(self.tracks)

    def doubts(self) -> list[str]:
        """Return actions beyond the car, and laps beyond the limit; see `Simulator.doubts`."""
        from repaint_cli.envs.racer.laps import doubts_about

        return doubts_about(self.tracks, self.actions, self.longest_episode(), self.objects)

    # The task

    @property
    def platform(self) -> str:
        """The paper's single-car or multi-car racing."""
        return "multi-car" if self.n_bots else "single-car"

    @property
    def choices(self) -> tuple[Any, ...]:
        """The actions, or what their ranges are."""
        return self.actions.texts if isinstance(self.actions, ActionRanges) else self.actions

    @property
    def reward_terms(self) -> frozenset[str]:
        """All terms that it can pay."""
        return TERMS | OBJECT_TERMS if self.n_objects else TERMS

    takes_symmetry: ClassVar[bool] = False

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Return the reflection from left to right, where each action has a mirror image."""
        return symmetries_of(self.actions, self.sensors)

    def why_no_symmetry(self) -> str | None:
        """Return which action has no mirror image; see `Simulator.why_no_symmetry`."""
        return unpaired_action(self.actions)

    # Files and code that a card brings along

    @classmethod
    def resolve_files(cls, env: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Return [env] with its tracks beside the card, and the settings of its `model_metadata`.

        The values of the card override those of its file. See `Simulator.resolve_files`.
        """
        from repaint_cli.envs.racer.deepracer.model_files import read_model_metadata

        env = dict(env)
        if "track" in env:
            env["track"] = beside(folder, env["track"])
        if isinstance(env.get("model_metadata"), str):
            return read_model_metadata(folder / env.pop("model_metadata")) | env
        return env

    def files(self) -> dict[str, Path]:
        """Return the tracks' files, where they are the user's."""
        return files_of(self.tracks)

    @property
    def reward_functions(self) -> "RewardFunctions":
        """DeepRacer's reward functions."""
        from repaint_cli.envs.racer.reward_functions import RacerRewardFunctions

        return RacerRewardFunctions(self)

    @classmethod
    def check_file(cls, name: str) -> CheckedFile | None:
        """Check a file of waypoints; see `Simulator.check_file`."""
        if not name.endswith(".npy"):
            return None
        from repaint_cli.envs.racer.track.map import check_track

        return check_track(name)

    # How episodes went

    score_episodes: ClassVar[int] = 20

    def columns(self, episodes: "Episodes", s: int) -> "list[Column]":
        """Return progress, laps, their times and crashes; see `Simulator.columns`."""
        from repaint_cli.envs.racer.outcomes import columns

        return columns(episodes, s)

    def parts(self, episodes: "Episodes", s: int) -> "Parts | None":
        """Return the episodes by track, where there are several; see `Simulator.parts`."""
        from repaint_cli.envs.racer.outcomes import parts

        return parts(episodes, s, labels_of(self.tracks))

    def outcomes(self, episodes: "Episodes") -> dict[str, Any]:
        """Return progress (%), lap times (s) and how episodes ended, as JSON."""
        from repaint_cli.envs.racer.outcomes import outcomes

        return outcomes(episodes, labels_of(self.tracks))

    # Paths, films, logs

    @property
    def place(self) -> str:
        """The track, or all of them."""
        return ", ".join(self.tracks)

    @property
    def paths(self) -> "RacerPaths":
        """The cars' paths."""
        from repaint_cli.envs.racer.paths import RacerPaths

        return RacerPaths(self.tracks, self.box_size[:2] if self.n_boxes else None)

    filmed_episodes: ClassVar[int] = 1
    films_observations: ClassVar[bool] = True

    def film(self, episodes: "Episodes", path: Path, title: str, n_episodes: int) -> None:
        """Film the track beside what the camera sees; see `Simulator.film`."""
        from repaint_cli.envs.racer.figures import film

        film(self, episodes, path, title, n_episodes)

    @property
    def logs(self) -> "LogFormat":
        """DeepRacer's logs."""
        from repaint_cli.envs.racer.deepracer.logs import DeepRacerLogs

        return DeepRacerLogs(self)
