"""Values of options that are more than a number or a name, and the settings behind them."""

from math import isfinite, nan

from repaint_cli.errors import UsageError
from repaint_cli.settings import MOST_SEEDS


def task_named(name: str | None) -> str:
    """Return the task's name.

    Raises:
        UsageError: there is no name, and no run to resume.
    """
    if name is None:
        raise UsageError("expected --task NAME (repaint tasks list), or --resume RUN")
    return name


def seed_list(first: int, how_many: int) -> list[int]:
    """Return the run seeds that --seed and --seeds ask for.

    Raises:
        UsageError: the number of seeds is below 1 or too large, or the first seed is negative.
    """
    if how_many < 1 or first < 0:
        raise UsageError(
            f"expected --seeds of at least 1 and --seed of at least 0, found {how_many} and {first}"
        )
    if how_many > MOST_SEEDS:
        raise UsageError(f"expected --seeds of at most {MOST_SEEDS:,}, found {how_many}")
    return list(range(first, first + how_many))


def trackers(track: list[str] | None, tensorboard: bool) -> list[str]:
    """Return the trackers that --track and --tensorboard ask for."""
    return [*(track or ()), *["tensorboard"] * tensorboard]


def parse_ratio(text: str) -> tuple[int, int]:
    """Read R:I.

    Raises:
        UsageError: the text is not R:I, or R is 0: nothing would train the critic.
    """
    parts = text.split(":")
    if len(parts) != 2 or not all(part.isdecimal() for part in parts) or int(parts[0]) < 1:
        raise UsageError(
            "expected --ratio R:I, R representation iterations (at least 1, someone must train the "
            f"critic) then I instance iterations, such as 1:1 or 2:1; found '{text}'"
        )
    return int(parts[0]), int(parts[1])


def parse_betas(text: str) -> float | list[float]:
    """Read β₀, or a β₀ for each teacher between commas.

    Raises:
        UsageError: a part is not a number.
    """
    try:
        betas = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise UsageError(
            f"expected --beta as a number, or one for each teacher such as 0.2,0.1; found '{text}'"
        ) from error
    return betas[0] if len(betas) == 1 else betas


def parse_targets(text: str) -> tuple[float, ...]:
    """Read --target: numbers with commas between, or none for auto.

    Raises:
        UsageError: a part is not a finite number, and the text not auto.
    """
    if text == "auto":
        return ()
    try:
        targets = tuple(float(part) for part in text.split(","))
    except ValueError:
        targets = (nan,)
    if not all(map(isfinite, targets)):
        raise UsageError(
            f"expected --target as a number, several such as -9,-8, or auto; found '{text}'"
        )
    return targets


def parse_methods(text: str, jobs: int) -> list[str]:
    """Read --methods, names between commas, and check --jobs.

    Raises:
        UsageError: there is no name, a name stands there twice, or the jobs are fewer than 1.
    """
    from repaint_cli.engines.train_methods import check_methods

    names = [name for name in text.split(",") if name]
    try:
        check_methods(names, jobs)
    except UsageError as error:
        raise UsageError(
            "expected --methods such as scratch,kickstart,repaint, each once, and --jobs of at "
            f"least 1, found '{text}' and {jobs}"
        ) from error
    return names


def ratio_settings(text: str) -> list[str]:
    """Return the settings behind --ratio.

    Raises:
        UsageError: the text is not R:I and not auto.
    """
    if text == "auto":
        return ["transfer.phases=auto"]
    representation, instance = parse_ratio(text)
    return [
        f"transfer.representation={representation}",
        f"transfer.instance={instance}",
        "transfer.phases=ratio",
    ]


def beta_settings(text: str) -> list[str]:
    """Return the settings behind --beta.

    Raises:
        UsageError: the text is not numbers and not auto.
    """
    if text == "auto":
        return ["transfer.kickstart_schedule=auto"]
    return [f"transfer.kickstart_coef={parse_betas(text)}"]


def threshold_settings(text: str) -> list[str]:
    """Return the settings behind --threshold."""
    return ["select.rule=auto" if text == "auto" else f"select.threshold={text}"]


def objective_settings(name: str) -> list[str]:
    """Return the settings behind --objective.

    An objective that does not bound an update uses each sample once.
    """
    unbounded = name in ("a2c", "reinforce")
    return [f"ppo.objective={name}", *["ppo.n_epochs=1"] * unbounded]
