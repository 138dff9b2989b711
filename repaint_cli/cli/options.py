"""Options that several commands share, and how they change a card."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from repaint_cli.errors import CardError, NotFound
from repaint_cli.tasks.methods import ALGORITHMS, METHODS
from repaint_cli.tasks.presets import PRESETS

if TYPE_CHECKING:
    from repaint_cli.tasks.card import TaskCard

Task = Annotated[
    str, typer.Option(help="A task's name (repaint tasks list) or a card of your own.")
]
TaskUnlessResumed = Annotated[
    str | None, typer.Option(help="A task's name (repaint tasks list) or a card of your own.")
]
Iterations = Annotated[
    int | None, typer.Option(help="Iterations of training; default: the card's.")
]
Seeds = Annotated[int, typer.Option(help="How many seeds to train side by side.")]
Seed = Annotated[int, typer.Option(help="The first seed; the others follow it.")]
EvalEpisodes = Annotated[
    int | None, typer.Option(help="Episodes per evaluation; default: the card's.")
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="<x.y=z>",
        help="Any other setting, as section.key=value (repaint tasks show TASK).",
    ),
]
Preset = Annotated[
    str | None,
    typer.Option(help="coach: the choices of the paper's framework; other options outrank it."),
]
Resume = Annotated[
    Path | None,
    typer.Option(
        metavar="RUN",
        help="Go on with a run as it began, perhaps for more --iterations.",
    ),
]
Keep = Annotated[
    int, typer.Option(metavar="<int>", help="Checkpoints to keep, the newest ones.", min=1)
]
RunFolder = Annotated[
    Path | None, typer.Option("--run", help="The run's folder; default: runs/TASK/METHOD-…")
]
TensorBoard = Annotated[
    bool, typer.Option("--tensorboard", help="Also write TensorBoard events to the run's folder.")
]


def customize(
    task: "TaskCard",
    settings: list[str] | None,
    preset: str | None = None,
    **options: object,
) -> "TaskCard":
    """Return the card with a preset, named options and --set applied, each over what was before.

    Args:
        task: the card.
        settings: `section.key=value` texts.
        preset: its name.
        options: `section__key=value`; None changes nothing.

    Raises:
        NotFound: there is no such preset.
        CardError: a setting is malformed or out of range.
    """
    if preset is not None and preset not in PRESETS:
        raise NotFound.named("preset", preset, PRESETS, "repaint transfer --help")
    chosen = list(PRESETS[preset]) if preset else []
    named = [
        f"{key.replace('__', '.')}={value}" for key, value in options.items() if value is not None
    ]
    return task.with_settings(chosen + named + (settings or []))


def seed_list(first: int, how_many: int) -> list[int]:
    """Return the run seeds.

    Raises:
        CardError: there would be none, or a negative one.
    """
    if how_many < 1 or first < 0:
        raise CardError(
            f"expected --seeds of at least 1 and --seed of at least 0, found {how_many} and {first}"
        )
    return list(range(first, first + how_many))


def check_alone(context: typer.Context, *allowed: str) -> None:
    """Check that beside --resume only options stand that do not change what the run is.

    Raises:
        CardError: another is there.
    """
    for option in context.command.params:
        source = context.get_parameter_source(option.name or "")
        given = source is not None and source.name == "COMMANDLINE"
        if given and option.name not in ("resume", *allowed):
            raise CardError(
                f"a run goes on as it began: leave out {option.opts[0]} beside --resume"
            )


def task_named(name: str | None) -> str:
    """Return the task's name.

    Raises:
        CardError: there is none, and nothing to resume.
    """
    if name is None:
        raise CardError("expected --task NAME (repaint tasks list), or --resume RUN")
    return name


def refuse(needed: str, **given: object) -> None:
    """Check that options are absent which go together with something else.

    Raises:
        CardError: one is there.
    """
    for option, value in given.items():
        if value not in (None, []):
            name = option.replace("_", "-")
            raise CardError(f"--{name} is for {needed}; leave it out")


def given_by(
    ratio: str | None, beta: str | None, select: str | None, threshold: str | None
) -> dict[str, object]:
    """Return the settings behind --select, and --ratio, --beta and --threshold, maybe "auto".

    Raises:
        CardError: one of them is something else, or another rule is to select than `auto`.
    """
    found: dict[str, object] = {"select__rule": select}
    if ratio == "auto":
        found["transfer__phases"] = "auto"
    else:
        representation, instance = parse_ratio(ratio)
        found |= {"transfer__representation": representation, "transfer__instance": instance}
        found |= {"transfer__phases": None if ratio is None else "ratio"}
    if beta == "auto":
        found["transfer__kickstart_schedule"] = "auto"
    else:
        found["transfer__kickstart_coef"] = parse_betas(beta)
    if threshold != "auto":
        return found | {"select__threshold": threshold}
    if select not in (None, "auto"):
        raise CardError(f"--threshold auto selects by itself; leave out --select {select}")
    return found | {"select__rule": "auto"}


def parse_ratio(text: str | None) -> tuple[int | None, int | None]:
    """Read R:I.

    Raises:
        CardError: it is something else, or R is 0: nothing would train the critic.
    """
    if text is None:
        return None, None
    parts = text.split(":")
    if len(parts) != 2 or not all(part.isdecimal() for part in parts) or int(parts[0]) < 1:
        raise CardError(
            "expected --ratio R:I, R representation iterations (at least 1, someone must train the "
            f"critic) then I instance iterations, such as 1:1 or 2:1; found '{text}'"
        )
    return int(parts[0]), int(parts[1])


def parse_betas(text: str | None) -> float | list[float] | None:
    """Read β₀, or a β₀ for each teacher between commas.

    Raises:
        CardError: it is something else.
    """
    if text is None:
        return None
    try:
        betas = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise CardError(
            f"expected --beta as a number, or one for each teacher such as 0.2,0.1; found '{text}'"
        ) from error
    return betas[0] if len(betas) == 1 else betas


def epochs_of(objective: str | None) -> int | None:
    """Return 1 for objectives that do not bound an update: each sample is to count once."""
    return 1 if objective in ("a2c", "reinforce") else None


def check_card(card: "TaskCard", **given: str | None) -> None:
    """Check that numbers given as options are not for what the card decides otherwise.

    Raises:
        CardError: one would change nothing.
    """
    numbers = {name for name, value in given.items() if value not in (None, "auto")}
    if "threshold" in numbers and card.select.rule not in ("zeta", "abs"):
        raise CardError(
            f"--threshold is for --select zeta or abs, found select.rule {card.select.rule}"
        )
    if numbers & {"beta", "beta_decay"} and card.transfer.kickstart_schedule == "auto":
        raise CardError("β is automatic here; leave out --beta and --beta-decay")


def method_for(algorithm: str, method: str | None) -> str:
    """Return the method's name, an algorithm's own default where none is given.

    Raises:
        NotFound: there is no such algorithm or method.
        CardError: they do not go together.
    """
    if algorithm not in ALGORITHMS:
        raise NotFound.named("algorithm", algorithm, ALGORITHMS, "repaint transfer --help")
    usual, *others = ALGORITHMS[algorithm]
    name = method or usual
    if name not in METHODS:
        raise NotFound.named("method", name, METHODS, "repaint transfer --help")
    if name not in (usual, *others):
        known = " or ".join((usual, *others))
        raise CardError(f"expected --method {known} with --algorithm {algorithm}, found '{name}'")
    return name


def check_method(name: str, algorithm: str = "ppo", **given: object) -> None:
    """Check that a method uses the options it is given.

    Raises:
        CardError: it leaves out what an option is about.
    """
    method = METHODS[name]
    by_gradient = algorithm == "ppo"
    used = {
        "auto": method.alternates and method.kickstart,
        "ratio": method.alternates and by_gradient,
        "beta": method.kickstart,
        "beta_decay": method.kickstart,
        "preset": by_gradient,
        "select": method.instance and by_gradient,
        "objective": by_gradient,
        "threshold": method.instance,
        "instances_from": method.instance,
        "transfer_iterations": method.kickstart or method.instance,
    }
    what = f"method '{name}'" + ("" if by_gradient else f" of {algorithm}")
    for option, value in given.items():
        if value is not None and not used[option]:
            raise CardError(
                f"expected an option that {what} uses, found "
                f"--{option.replace('_', '-')}; leave it out or choose another --method"
            )
