"""The options of `repaint transfer`."""

from typing import Annotated, NamedTuple

import typer

from repaint_cli.cli import completion
from repaint_cli.cli.option_rules import (
    ALTERNATING,
    INSTANCE,
    KICKSTART,
    TAUGHT,
    Condition,
    Rule,
    settings_of,
)
from repaint_cli.cli.option_values import (
    beta_settings,
    objective_settings,
    ratio_settings,
    threshold_settings,
)
from repaint_cli.cli.options import (
    HOW,
    LONG,
    WHOM,
    Device,
    DryRun,
    EvalEpisodes,
    Iterations,
    Keep,
    Preset,
    Resume,
    RunFolderOption,
    Seed,
    Seeds,
    Set,
    TaskOption,
    TensorBoard,
    Track,
    option,
)
from repaint_cli.tasks.methods import METHODS
from repaint_cli.tasks.presets import says_how

METHOD_HELP = "; ".join(f"{name}: {method.summary}" for name, method in METHODS.items())

ONE_SELECTION = Condition(
    lambda options: options.select == "auto" or options.threshold != "auto",
    "--threshold auto selects by itself; leave out --select {other.select}",
)
BY_THRESHOLD = Condition(
    lambda card: card.select.rule in ("zeta", "abs"),
    "{option} is for --select zeta or abs, found select.rule {other.select.rule}",
)
BETA_BY_HAND = Condition(
    lambda card: card.transfer.kickstart_schedule != "auto",
    "β is automatic here; leave out --beta and --beta-decay",
)


class TransferOptions(NamedTuple):
    """The options of `repaint transfer`, in the order of its help."""

    context: typer.Context
    task: TaskOption = None
    teacher: Annotated[
        list[str] | None,
        option(
            WHOM,
            "TEACHER",
            "A teacher's name (repaint zoo list) or file; again for several. auto: who earns most "
            "without training (repaint zoo rank).",
            autocompletion=completion.teachers,
        ),
        Rule(methods=TAUGHT),
    ] = None
    view: Annotated[
        str | None,
        option(
            WHOM,
            "VIEW",
            "How teachers without a view of their own (NAME:mirrored, NAME:both) are looked at: "
            "none, mirror, both, or auto: what earns most in two to five episodes. Default: auto "
            "where what is measured decides (--auto), else none.",
        ),
        Rule(methods=TAUGHT),
    ] = None
    instances_from: Annotated[
        list[str] | None,
        option(
            WHOM,
            "TEACHER",
            "The teacher to take samples from; again for several. Default: all.",
            autocompletion=completion.teachers,
        ),
        Rule(methods=INSTANCE),
    ] = None
    method: Annotated[
        str | None,
        option(
            HOW,
            "METHOD",
            f"{METHOD_HELP}. Default: repaint, as --auto has it.",
            autocompletion=completion.methods,
        ),
    ] = None
    algorithm: Annotated[
        str,
        option(
            HOW,
            "NAME",
            "ppo; or q-learning, with --method instance (default) or scratch.",
            autocompletion=completion.algorithms,
        ),
    ] = "ppo"
    preset: Preset = None
    auto: Annotated[
        bool,
        option(
            HOW,
            None,
            "Let what is measured decide how to use the teacher, but for what other options say. "
            "The default where none of this kind is given, nor --instances-from, "
            "--transfer-iterations, or --set of transfer (but transfer.teacher_episodes), select "
            "or ppo.objective.",
            "--auto",
        ),
        Rule(methods=KICKSTART & ALTERNATING),
    ] = False
    ratio: Annotated[
        str | None,
        option(HOW, "R:I", "R representation iterations, then I instance iterations; or auto."),
        Rule(ratio_settings, methods=ALTERNATING, algorithms=("ppo",)),
    ] = None
    beta: Annotated[
        str | None,
        option(
            HOW,
            "FLOAT",
            "β₀, the first weight of the cross-entropy; one for each teacher as 0.2,0.1; or auto.",
        ),
        Rule(beta_settings, methods=KICKSTART, card=BETA_BY_HAND),
    ] = None
    beta_decay: Annotated[
        float | None,
        option(HOW, "FLOAT", "The factor of β after each iteration."),
        Rule("transfer.kickstart_decay", methods=KICKSTART, card=BETA_BY_HAND),
    ] = None
    select: Annotated[
        str | None,
        option(
            HOW, "RULE", "Which teacher samples to keep: zeta, abs, top, per, rbt, all or auto."
        ),
        Rule("select.rule", methods=INSTANCE, algorithms=("ppo",), options=ONE_SELECTION),
    ] = None
    threshold: Annotated[
        str | None,
        option(HOW, "FLOAT", "ζ: keep teacher samples with an advantage of at least ζ; or auto."),
        Rule(
            threshold_settings,
            q_learning="q_learning.threshold",
            methods=INSTANCE,
            card=BY_THRESHOLD,
        ),
    ] = None
    objective: Annotated[
        str | None,
        option(HOW, "NAME", "clipped (PPO), a2c, trpo or reinforce."),
        Rule(objective_settings, algorithms=("ppo",)),
    ] = None
    iterations: Iterations = None
    transfer_iterations: Annotated[
        int | None,
        option(
            LONG, "INT", "K, the last iteration with the teacher. Default: the card's, or measured."
        ),
        Rule("transfer.iterations", methods=KICKSTART | INSTANCE),
    ] = None
    seeds: Seeds = 1
    seed: Seed = 0
    eval_episodes: EvalEpisodes = None
    set: Set = None  # after all other settings: it overrides them
    device: Device = "cpu"
    dry_run: DryRun = False
    resume: Resume = None
    run: RunFolderOption = None
    keep: Keep = 1
    track: Track = None
    tensorboard: TensorBoard = False

    @property
    def automatic(self) -> bool:
        """Whether what is measured decides how teachers are used."""
        settings = settings_of(self, self.algorithm)
        by_choice = self.method, self.algorithm != "ppo", self.instances_from, self.preset
        return self.auto or not says_how(settings, *by_choice)
