"""The methods that can be compared: which parts of REPAINT each switches on."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from repaint_cli.errors import NotFound, UsageError

if TYPE_CHECKING:
    from repaint_cli.tasks.transfer_settings import TransferConfig


@dataclass(frozen=True)
class Method:
    """A row of the table of methods: which parts of REPAINT are switched on."""

    summary: str
    warm_start: bool = False
    kickstart: bool = False
    instance: bool = False
    joint: bool = False

    @property
    def needs_teacher(self) -> bool:
        """Whether the method uses a teacher at all."""
        return self.warm_start or self.kickstart or self.instance

    @property
    def alternates(self) -> bool:
        """Whether representation and instance iterations take turns."""
        return self.instance and not self.joint

    def apply(self, transfer: "TransferConfig") -> "TransferConfig":
        """Switch off what this method leaves out; what remains is all the trainer sees."""
        off: dict[str, float | bool | str] = {"joint": self.joint}
        if self.warm_start or not self.needs_teacher:
            off["start"] = "teacher" if self.warm_start else "untrained"
        if not self.kickstart:
            off |= {"kickstart_coef": 0.0, "kickstart_schedule": "geometric", "distill_epochs": 0}
        if not self.instance:
            off |= {"instance": 0, "phases": "ratio"}
        if not (self.kickstart or self.instance):
            off |= {"alpha_1": 1.0, "alpha_power": 0.0}
        return transfer.model_copy(update=off)


METHODS = {
    "scratch": Method("clipped PPO, no teacher"),
    "warm-start": Method("PPO from the teacher's weights", warm_start=True),
    "kickstart": Method("representation transfer alone", kickstart=True),
    "instance": Method("instance transfer alternating with PPO", instance=True),
    "repaint": Method("both, alternating (algorithm 2)", kickstart=True, instance=True),
    "repaint-joint": Method(
        "both in one update (algorithm 1)", kickstart=True, instance=True, joint=True
    ),
}

ALGORITHMS = {
    "ppo": ("repaint", *(name for name in METHODS if name != "repaint")),
    "q-learning": ("instance", "scratch"),
}
"""Methods that each algorithm knows; the first is its default."""


def method_for(algorithm: str, method: str | None) -> str:
    """Return the method's name, an algorithm's own default where none is given.

    Raises:
        NotFound: there is no such algorithm or method.
        UsageError: the algorithm does not have the method.
    """
    if algorithm not in ALGORITHMS:
        raise NotFound.named("algorithm", algorithm, ALGORITHMS, "repaint transfer --help")
    default, *others = ALGORITHMS[algorithm]
    name = method or default
    if name not in METHODS:
        raise NotFound.named("method", name, METHODS, "repaint transfer --help")
    if name not in (default, *others):
        known = " or ".join((default, *others))
        raise UsageError(f"expected --method {known} with --algorithm {algorithm}, found '{name}'")
    return name
