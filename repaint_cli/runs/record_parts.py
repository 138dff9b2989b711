"""The parts of run.json: alarms, teachers, and versions that a run went on with."""

from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
)
from pydantic_core import PydanticUseDefault

from repaint_cli.zoo.view_names import with_view

LENIENT = {"lenient": True}
"""The validation context in which a malformed part counts as absent, where it has a default."""


def or_default(value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
    """Validate a part that only a resumed run needs; see `LENIENT`."""
    try:
        return handler(value)
    except ValidationError:
        if info.context == LENIENT:
            raise PydanticUseDefault from None
        raise


class Alarm(BaseModel):
    """Something in an iteration that looks wrong."""

    model_config = ConfigDict(frozen=True)

    iteration: int
    """After which it was noticed."""
    kind: str
    """Its kind, in a word."""
    text: str
    """Its text, a sentence."""


class TeacherRecord(BaseModel):
    """A teacher of a run."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+(@shipped)?$")]
    """As in its file; NAME@shipped of a shipped one behind the user's own."""
    view: Annotated[str, Field(pattern=r"^[A-Za-z-]*$")] = ""
    """As it is looked at: "" as it is, a symmetry's name, or "both"."""
    sha256: str = ""
    """Of its file."""
    instances: bool = True
    """Whether its own samples are learned from."""
    file: str = ""
    """Where its file was."""

    _lenient = field_validator("sha256", "instances", "file", mode="wrap")(or_default)

    @property
    def absent(self) -> list[str]:
        """The parts that a resumed run needs, and that an earlier version left out."""
        return sorted({"sha256", "instances", "file"} - self.model_fields_set)

    @property
    def label(self) -> str:
        """The name with the view, as it is typed."""
        return with_view(self.name, self.view)


class RankedRecord(BaseModel):
    """A teacher, as it is looked at, that played the task before the run; see `zoo.ranking`."""

    name: str
    """As it is typed; "untrained" of policies that know nothing."""
    mean: float
    """Of its returns."""
    low: float
    """Lower end of its 95 % interval over episodes."""
    high: float
    """Upper end."""
    better: float
    """How often a fresh critic calls one of its steps better than an untrained policy's."""
    cosine: float | None
    """Of its task's weights, as it is looked at, and the target's."""
    steps: NonNegativeInt
    """That it played."""
    seconds: NonNegativeFloat = 0.0
    """How long that took."""
    returns: tuple[float, ...] = ()
    """Of its episodes."""
    teachers: tuple[NonNegativeInt, ...] = ()
    """Which of the run's teachers it became, from 0."""


class Resumption(BaseModel):
    """Other versions that a run went on with."""

    after: int
    """The last iteration with the versions before."""
    versions: dict[str, str]
    """Of the libraries."""
