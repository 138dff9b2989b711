"""A teacher's card, in the header of its file: whole and checked, or the summary for a list."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from pydantic import (
    Field,
    NonNegativeInt,
    PositiveInt,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from repaint_cli.errors import CheckpointError, StoreError
from repaint_cli.files.headers import peek_header, read_header
from repaint_cli.settings import Settings, first_problem
from repaint_cli.tasks.card import TaskCard

if TYPE_CHECKING:
    from repaint_cli.policies.spaces import Spaces

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
"""Of teachers."""

NAMES = "1 to 64 letters, digits, '.', '_' or '-'"
"""The pattern of names, for messages."""


class Score(Settings):
    """A deterministic evaluation on seeds that training never saw."""

    mean: float
    """Mean return."""
    low: float
    """Lower end of its 95 % bootstrap confidence interval over episodes."""
    high: float
    """Upper end."""
    episodes: PositiveInt
    """Of the evaluation."""
    progress: float | None = None
    """Mean share of a lap, in %, on the track."""
    laps: int | None = None
    """Episodes that completed the lap."""

    @property
    def interval(self) -> str:
        """The mean with its interval, as people write it."""
        return interval_text(self.mean, self.low, self.high)

    def __str__(self) -> str:
        """Return it with the number of episodes."""
        return f"{self.interval} over {self.episodes} episodes"


class TeacherCard(Settings):
    """A teacher and its origin."""

    schema_version: Literal[1] = 1
    """Version of this record."""
    name: str
    """Of the teacher."""
    task: TaskCard
    """Its training task, whole."""
    obs_shape: tuple[PositiveInt, ...]
    """O."""
    n_actions: PositiveInt
    """A."""
    discrete: bool
    """Whether actions are numbers."""
    n_beams: NonNegativeInt = 0
    """Ranges of a lidar beside an image."""
    parts: dict[str, tuple[PositiveInt, ...]] = Field(default_factory=dict)
    """Shapes of several images and vectors by name, where observations are that."""
    sizes: tuple[PositiveInt, ...] = ()
    """Of each number of a compound action."""
    uses: tuple[tuple[bool, ...], ...] = Field(default=(), validate_default=True)
    """Which of its numbers count, with each value of the first."""
    algorithm: str = "ppo"
    """That trained it; the policy of q-learning has Q for its logits, and no critic."""
    method: str
    """Of transfer, or scratch."""
    seed: NonNegativeInt
    """Its run seed."""
    iteration: NonNegativeInt
    """After which it was saved."""
    env_steps: NonNegativeInt
    """That it was trained for."""
    score: Score | None = None
    """On its own task."""
    versions: dict[str, str]
    """Of the libraries that made it."""
    parents: tuple[str, ...] = ()
    """SHA-256 of its own teachers' files, if it had any."""
    created: str
    """When, UTC."""

    @model_validator(mode="before")
    @classmethod
    def _one_parent(cls, data: Any) -> Any:
        """Read files from before a teacher could have several teachers."""
        if isinstance(data, dict) and "parent" in data:
            parent = data["parent"]
            rest = {key: value for key, value in data.items() if key != "parent"}
            return {"parents": [parent] if parent else []} | rest
        return data

    @field_validator("name")
    @classmethod
    def _of_a_file(cls, name: str) -> str:
        """Refuse the names that `check_name` refuses, for folders have this name too."""
        if not NAME.fullmatch(name):
            raise ValueError(f"expected {NAMES}")
        return name

    @field_validator("obs_shape")
    @classmethod
    def _vector_or_image(cls, shape: tuple[int, ...]) -> tuple[int, ...]:
        if len(shape) not in (1, 3):
            raise ValueError("expected the size of a vector, or the three of an image")
        return shape

    @field_validator("parts")
    @classmethod
    def _vectors_and_images(
        cls, parts: dict[str, tuple[int, ...]], info: ValidationInfo
    ) -> dict[str, tuple[int, ...]]:
        """Refuse parts that no networks read."""
        if any(len(shape) not in (1, 3) for shape in parts.values()):
            raise ValueError("expected vectors and images")
        images = [shape for shape in parts.values() if len(shape) == 3]
        if parts and (info.data.get("n_beams") or info.data.get("obs_shape") not in images):
            raise ValueError("expected an image of obs_shape among them, and no lidar beside them")
        return parts

    @field_validator("uses")
    @classmethod
    def _of_its_sizes(
        cls, uses: tuple[tuple[bool, ...], ...], info: ValidationInfo
    ) -> tuple[tuple[bool, ...], ...]:
        """Refuse sizes and uses that do not go together."""
        sizes, n_actions = info.data.get("sizes", ()), info.data.get("n_actions")
        if sizes and sum(sizes) != n_actions:
            raise ValueError(f"expected sizes with the sum n_actions, {n_actions}, beside it")
        rows = [len(row) for row in uses]
        if rows != ([len(sizes) - 1] * sizes[0] if sizes else []):
            raise ValueError("expected a row for each value of the first of sizes")
        return uses

    @property
    def spaces(self) -> "Spaces":
        """The sizes of observations and actions."""
        from repaint_cli.policies.spaces import Spaces

        return Spaces(
            self.obs_shape, self.n_actions, self.discrete, self.n_beams, tuple(self.parts.items()),
            self.sizes, self.uses,
        )  # fmt: skip


class TeacherSummary(NamedTuple):
    """A teacher in a list; its card is read, not checked."""

    task: str
    score: tuple[float, float, float] | None
    """Mean, lower and upper end."""
    env_steps: int


def interval_text(mean: float, low: float, high: float) -> str:
    """Return a score's mean with its interval, as people write it."""
    return f"{mean:.4g} [{low:.4g}, {high:.4g}]"


def read_card(path: Path) -> TeacherCard:
    """Read a teacher's card from its file.

    Raises:
        CheckpointError: the file is damaged or not one of ours, or its card is invalid.
    """
    try:
        return TeacherCard.model_validate(read_header(path))
    except ValidationError as error:
        raise CheckpointError(f"{path}: its card does not fit: {first_problem(error)}") from error


def read_summary(path: Path) -> TeacherSummary:
    """Read a teacher's summary, quickly: a zoo may hold thousands.

    Raises:
        CheckpointError: the file is damaged or not one of ours, or its card has no summary.
    """
    try:
        header = peek_header(path)
    except CheckpointError:  # the card may be longer than what was read
        header = read_header(path)
    try:
        score, steps = header.get("score"), int(header["env_steps"])
        interval = (
            (float(score["mean"]), float(score["low"]), float(score["high"])) if score else None
        )
        if steps.bit_length() > 64:
            raise ValueError("expected env_steps of at most 64 bits")
        return TeacherSummary(str(header["task"]["name"]), interval, steps)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise CheckpointError(f"{path}: its card does not fit: {error!r}") from error


def check_name(name: str) -> None:
    """Check a teacher's name.

    Raises:
        StoreError: the name does not match `NAME`, or stands for the best of all teachers.
    """
    if name == "auto":
        raise StoreError("expected another name than auto: --teacher auto is the best of the zoo")
    if not NAME.fullmatch(name):
        raise StoreError(f"expected a teacher's name of {NAMES}, found {name!r}")
