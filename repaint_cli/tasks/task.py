"""A task is an environment and the weights w of its reward terms φ: what is to be learned.

The numbers with which it is learned are a recipe; a card is both.
"""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import (
    BeforeValidator,
    Field,
    SerializeAsAny,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from repaint_cli.envs.registry import simulator_class
from repaint_cli.envs.simulator import Simulator
from repaint_cli.errors import CardError
from repaint_cli.settings import EvalConfig, Settings
from repaint_cli.symmetry import Symmetry
from repaint_cli.tasks.symmetry import SymmetryConfig

if TYPE_CHECKING:
    from repaint_cli.envs.reward_functions import Functions
    from repaint_cli.envs.reward_terms import RewardTerms
    from repaint_cli.policies.spaces import Spaces


FUNCTION = "function"
"""The reward term that a user's own reward function pays."""
SCALE = "scale"
"""What a card calls the weight of that term."""


class RewardCode(Settings):
    """A user's own reward function: a file's name and its text."""

    name: str
    """What the file is called."""
    source: str
    """Python, with `def reward_function(params)`."""
    file: str | None = Field(None, exclude=True)
    """Where it was read, which makes no difference, and which no card or teacher tells."""

    def __eq__(self, other: object) -> bool:
        """Return whether both have the same text under the same name."""
        if not isinstance(other, RewardCode):
            return NotImplemented
        return (self.name, self.source) == (other.name, other.source)

    def __hash__(self) -> int:
        return hash((self.name, self.source))


def _by_its_class(env: Any) -> Any:
    """Check [env] by the class of the simulator that it names."""
    if isinstance(env, Simulator):
        return env
    if not isinstance(env, Mapping):
        raise ValueError("expected a valid dictionary or object to extract fields from")
    return simulator_class(env.get("simulator")).model_validate(env)


class Task(Settings):
    """A task. Equal tasks have the same environment and pay the same for every step."""

    env: Annotated[SerializeAsAny[Simulator], BeforeValidator(_by_its_class)]
    """The simulator and its settings."""
    reward: dict[str, float]
    """Weights w by the names of the terms φ, in multiples of the environment's own coefficients."""
    reward_code: RewardCode | None = None
    """In place of weighed terms: a function of the racer's `params`, the one term "function"."""
    symmetry: SymmetryConfig | None = Field(None, exclude_if=lambda value: value is None)
    """A reflection of the environment, in place of those that the simulator knows. The task is the
    same without."""

    @field_validator("reward")
    @classmethod
    def _some_weight(cls, weights: dict[str, float]) -> dict[str, float]:
        if not any(weights.values()):
            raise ValueError("at least one weight must differ from 0")
        return weights

    @model_validator(mode="after")
    def _code_has_its_simulator(self) -> "Task":
        if self.reward_code and self.env.reward_functions is None:
            raise ValueError("a reward function needs the racer's params: env.simulator = 'racer'")
        if self.reward_code and list(self.reward) != [FUNCTION]:
            raise ValueError("a reward function stands alone: leave the other terms out")
        if self.reward_code and self.reward[FUNCTION] <= 0:
            raise ValueError(
                f"a reward function has a {SCALE} above 0, found {self.reward[FUNCTION]:g}"
            )
        return self

    @field_validator("symmetry")
    @classmethod
    def _of_its_terms(
        cls, symmetry: SymmetryConfig | None, info: ValidationInfo
    ) -> SymmetryConfig | None:
        env, reward = info.data.get("env"), info.data.get("reward")
        if symmetry is None or env is None or reward is None:
            return symmetry
        if not env.takes_symmetry:
            raise ValueError(f"expected none, as the simulator '{env.simulator}' knows its own")
        if unknown := sorted(set(symmetry.odd) - reward.keys()):
            problem = PydanticCustomError("odd", "expected terms that [reward] names")
            where = InitErrorDetails(type=problem, loc=("odd",), input=unknown)
            raise ValidationError.from_exception_data(cls.__name__, [where])
        return symmetry

    def __eq__(self, other: object) -> bool:
        """Return whether both are the same task; a term that weighs 0 makes no difference."""
        return isinstance(other, Task) and self.difference(other) is None

    def __hash__(self) -> int:
        return hash((self.env.simulator, frozenset(self._weights().items()), self.reward_code))

    def difference(self, other: "Task") -> str | None:
        """Return the section of a card in which two tasks differ, or None."""
        if self.env != other.env and self.env.settled() != other.env.settled():
            return "env"
        if self._weights() != other._weights():
            return "reward"
        return "reward_code" if self.reward_code != other.reward_code else None

    def _weights(self) -> dict[str, float]:
        return {name: weight for name, weight in self.reward.items() if weight}

    @property
    def terms(self) -> frozenset[str]:
        """The terms that it has a weight for: those it names, and 0 for those it could be paid."""
        return frozenset(self.reward) | (self.env.reward_terms or frozenset())

    def weights(self, terms: Iterable[str]) -> list[float]:
        """Return w of some of its terms, in their order; 0 for those that it does not name."""
        return [self.reward.get(name, 0.0) for name in terms]

    def changing_terms(self, symmetry: Symmetry) -> list[str]:
        """Return its terms that do not stay the same in a mirror, or of which that is not known."""
        return [name for name in self._weights() if symmetry.parity(name) != 1]

    def in_mirror(self, symmetry: Symmetry | None) -> Self | None:
        """Return the task that a policy's mirror image fulfils; None where that is not known."""
        if symmetry is None:
            return self
        parities = {name: symmetry.parity(name) for name in self._weights()}
        if self.reward_code or None in parities.values():
            return None
        changed = {name: -self.reward[name] for name, parity in parities.items() if parity == -1}
        return self.model_copy(update={"reward": self.reward | changed}) if changed else self

    def naming(self, terms: Iterable[str]) -> Self:
        """Return the same task with these terms too, with weight 0 where it has none."""
        absent = {name: 0.0 for name in sorted(terms) if name not in self.reward}
        return self.model_copy(update={"reward": self.reward | absent}) if absent else self

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """The reflection that the card names, else those that the simulator knows."""
        return (self.symmetry.symmetry(),) if self.symmetry else self.env.symmetries()

    def why_no_symmetry(self) -> str | None:
        """Return why `symmetries` is empty, for people; None where it is not."""
        return None if self.symmetry else self.env.why_no_symmetry()

    def check_symmetry(self, spaces: "Spaces") -> None:
        """Check that the symmetry that the card names, if it does, fits its environment.

        Raises:
            CardError: its numbers are not those of these spaces, or several observations or numbers
                of an action would have to be mirrored.
        """
        if (spaces.sizes or spaces.parts) and self.env.symmetries():
            raise CardError(f"expected one observation and one number to mirror, found {spaces}")
        if self.symmetry:
            self.symmetry.check_fits(spaces)

    def code_at_risk(self) -> str | None:
        """Return what of it is user code or a user file, for people; None where nothing is."""
        if self.reward_code:
            return f"the reward function {self.reward_code.name}"
        return self.env.code_at_risk()

    @property
    def gpu_simulator(self) -> Simulator | None:
        """The simulator on a GPU, or None where training needs something of the CPU."""
        return None if self.reward_code else self.env.gpu_simulator()

    def make_env(
        self,
        n_envs: int,
        *,
        one_episode: bool = False,
        noise: EvalConfig | None = None,
        training: bool = False,
        replayable: bool = False,
        functions: "Functions | None" = None,
        on_gpu: bool = False,
    ) -> "RewardTerms":
        """Make N copies of the environment; their rewards are w·φ.

        Args:
            n_envs: N.
            one_episode: whether environments may stop for good after their first episode.
            noise: the amplitudes of evaluation noise, where it is wanted and the simulator has it.
            training: see `Simulator.make`.
            replayable: whether their episodes are to be such as can be played again, if possible.
            functions: the user's reward functions of earlier copies; see `RewardFunctions.apply`.
            on_gpu: whether they are to be on a GPU, where `gpu_simulator`.

        Raises:
            CardError: the environment cannot be made.
            DeviceError: they are to be on a GPU, and none works, or it is too small.
        """
        from repaint_cli.envs.output import captured
        from repaint_cli.envs.reward_terms import RewardTerms

        with captured():
            made = self.env.make_replayable(n_envs) if replayable else None
            simulator = (on_gpu and self.gpu_simulator) or self.env
            env = made or simulator.make(n_envs, one_episode, noise, training)
        code, kind = self.reward_code, self.env.reward_functions
        if code and kind:
            env = kind.apply(env, code.name, code.source, functions)
        return RewardTerms(env, self.reward, self.env.records, replayable=made is not None)
