"""What an experiment is: pairs of task and teachers, variants of training, seeds, what is drawn.

A panel is one task with its teachers; in each panel all variants are trained. What the paper says
of the same panel stands beside it.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PositiveFloat, PositiveInt, model_validator

from repaint_cli.errors import UsageError
from repaint_cli.settings import MOST_SEEDS, Settings
from repaint_cli.tasks.methods import METHODS

NEVER = "not achieved"
"""What the paper writes where a method did not reach the target."""

Reached = PositiveInt | Literal["not achieved"]
Hours = PositiveFloat | Literal["not achieved"]


def _plain_name(text: Any) -> Any:
    """Refuse names that a column of a CSV or a table of Markdown cannot hold."""
    if isinstance(text, str) and (not text.isprintable() or set(text) & set(',"|') or not text):
        raise ValueError('expected a name without , " |')
    return text


Name = Annotated[str, BeforeValidator(_plain_name)]


class PaperNumbers(Settings):
    """What the paper's tables 1 and 6 say of a panel, by the names of the variants."""

    teacher: str
    """The teacher's type: similar, different, or a sub-task."""
    target: float
    """The target score, the best of training from scratch."""
    k: dict[str, Reached]
    """Iterations to the target."""
    best: dict[str, float] = Field(default_factory=dict)
    """Best scores."""
    hours: dict[str, Hours] = Field(default_factory=dict)
    """Wall-clock hours to the target."""
    hardware: str = ""
    """What these hours were measured on."""

    def reduced(self, variant: str, hours: bool = False) -> float | None:
        """Return 1 − K / K of scratch, or the same of hours; None where the paper has none."""
        numbers: dict[str, Any] = dict(self.hours if hours else self.k)
        own, basis = numbers.get(variant), numbers.get("scratch")
        if variant == "scratch" or isinstance(own, str | None) or isinstance(basis, str | None):
            return None
        return float(1 - own / basis)


class MadeTeacher(Settings):
    """A teacher that is not shipped: trained from scratch first, its best evaluated policy kept."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$")]
    """What panels call it."""
    task: str
    """Its task's name, or the path of a card."""
    settings: tuple[str, ...] = ()
    """Of its card, as `section.key=value`."""
    seeds: Annotated[tuple[int, ...], Field(min_length=1)] = (50, 51, 52)
    """Of which the best evaluated policy is kept; the students have others."""
    iterations: int = Field(gt=0)
    """Of its training."""


class Variant(Settings):
    """One way to train in a panel: a method, and settings that are swept."""

    name: Name
    """In the legend and in tables."""
    method: str = "repaint"
    """The method."""
    settings: tuple[str, ...] = ()
    """Of the card, as `section.key=value`; they outrank those of preset and scale."""
    teachers: tuple[str, ...] | None = None
    """In place of the panel's."""
    auto: bool = False
    """Whether what is measured decides how teachers are used, as `repaint transfer` has it."""

    @model_validator(mode="after")
    def _known(self) -> "Variant":
        if self.method not in METHODS:
            raise ValueError(f"expected a method ({', '.join(METHODS)}), found '{self.method}'")
        if self.auto and self.method != "repaint":
            raise ValueError(f"expected method 'repaint' to be automatic, found '{self.method}'")
        return self


def _variant(value: Any) -> Any:
    """Take a method's name for the variant that is called so and has no settings."""
    return {"name": value, "method": value} if isinstance(value, str) else value


Variants = tuple[Annotated[Variant, BeforeValidator(_variant)], ...]


class Panel(Settings):
    """A task with its teachers, in which all variants are trained."""

    title: Name
    """Over the panel, and in tables."""
    task: str
    """The task's name, or the path of a card."""
    teachers: tuple[str, ...] = ()
    """Their names in the zoo or in [[teachers]], or their files."""
    variants: Variants = ()
    """In place of the experiment's."""
    target: float | None = None
    """The score to reach; the best mean from scratch where absent, as in the paper."""
    paper: PaperNumbers | None = None
    """What the paper says of it."""

    def of(self, variant: Variant) -> tuple[str, ...]:
        """Return the names of the teachers that a variant learns from here."""
        if not METHODS[variant.method].needs_teacher:
            return ()
        return self.teachers if variant.teachers is None else variant.teachers


class Scale(Settings):
    """How much is trained."""

    seeds: int = Field(gt=0, le=MOST_SEEDS)
    """How many seeds of each variant."""
    first_seed: int = Field(0, ge=0)
    """The first of them: 0 where results are judged; where numbers are chosen, others."""
    iterations: int = Field(gt=0)
    """Of training."""
    settings: tuple[str, ...] = ()
    """Of all cards, as `section.key=value`; they outrank those of the preset."""
    seconds: float | None = Field(None, gt=0)
    """About how long an iteration of one seed takes on two cores; measured first where absent."""
    teacher_iterations: int | None = Field(None, gt=0)
    """Of training teachers that are made; their own where absent."""
    short: bool = False
    """Whether episodes are few and short; see `cards.smoke_settings`."""


SMOKE = Scale(seeds=2, iterations=2, seconds=0.5, teacher_iterations=2, short=True)
"""Every experiment's smoke scale; what is short besides is in `cards.smoke_settings`."""
SCALES = ("smoke", "night", "paper")
"""Minutes; a night on two cores; about the paper's seeds and horizon."""


class Experiment(Settings):
    """An experiment, as its TOML file says; equal ones train the same and draw the same."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$")]
    """The file's name without its suffix."""
    file: str = Field("", exclude=True)
    """What it is called on a command line: a name, or the path of a file of one's own."""
    summary: str
    """One sentence: what it shows."""
    item: str
    """Of the paper: "figure 1"."""
    claim: str = ""
    """What the paper says of it, in a sentence."""
    order: int = 1000
    """Where it stands in the list."""
    preset: Literal["paper", "coach", ""] = "paper"
    """The preset of all cards; "" for the cards as they are."""
    variants: Variants = ()
    """What is trained in each panel: methods' names, or tables with settings."""
    panels: tuple[Panel, ...] = ()
    """Side by side in the figure."""
    gathers: tuple[str, ...] = ()
    """Experiments whose panels with numbers of the paper are tabled, in place of own panels."""
    teachers: tuple[MadeTeacher, ...] = ()
    """Those that are trained first."""
    figure: Literal["curves", "trajectories", "none"] = "curves"
    """What is drawn: learning curves, or the paths of the last policies."""
    show: tuple[Literal["return", "progress"], ...] = ("return",)
    """The figure's rows."""
    table: Literal["rows", "iterations", "time"] = "rows"
    """What is tabled: a row a variant; or, as in tables 1 and 6, a row a panel with K or the time
    to the target of each variant."""
    smoothing: PositiveInt = 1
    """Iterations over which the drawn curves are averaged; numbers in tables never are."""
    smoke: tuple[str, ...] = ()
    """Further settings of all cards at the scale smoke, as `section.key=value`."""
    scales: dict[Literal["night", "paper"], Scale] = Field(default_factory=dict)
    """How much is trained at each scale; every experiment has the scale smoke."""

    @model_validator(mode="after")
    def _consistent(self) -> "Experiment":
        if bool(self.panels) == bool(self.gathers):
            raise ValueError("expected either panels or gathers")
        _once("panel", (panel.title for panel in self.panels))
        _once("teacher", (teacher.name for teacher in self.teachers))
        for panel in self.panels:
            variants = self.variants_of(panel)
            if not variants:
                raise ValueError(f"expected variants in panel '{panel.title}'")
            _once("variant", (variant.name for variant in variants))
            for variant in variants:
                if METHODS[variant.method].needs_teacher and not panel.of(variant):
                    raise ValueError(f"expected teachers for '{variant.name}' in '{panel.title}'")
        return self

    def variants_of(self, panel: Panel) -> Sequence[Variant]:
        """Return what is trained in a panel."""
        return panel.variants or self.variants

    @property
    def scale_names(self) -> list[str]:
        """The scales that it has; one that gathers has those of what it gathers."""
        return [name for name in SCALES if name == "smoke" or name in self.scales or self.gathers]

    def scale(self, name: str) -> Scale:
        """Return a scale.

        Raises:
            UsageError: the experiment does not have it.
        """
        if name == "smoke":
            return SMOKE.model_copy(update={"settings": self.smoke})
        for known, scale in self.scales.items():
            if known == name:
                return scale
        raise UsageError(
            f"experiment '{self.name}' has no scale '{name:.40}', expected --scale "
            f"{' or '.join(self.scale_names)}"
        )


def _once(kind: str, names: Iterable[str]) -> None:
    twice = [name for name, n in Counter(names).items() if n > 1]
    if twice:
        raise ValueError(f"expected every {kind} once, found '{twice[0]}' again")
