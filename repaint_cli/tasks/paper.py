"""The numbers that the paper's text gives, and those of its framework, RL Coach.

Settings as in `--set`, by the platforms of the paper's experiments; see `Simulator.platform`.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from repaint_cli.tasks.card_settings import settings_of

if TYPE_CHECKING:
    from repaint_cli.tasks.card import TaskCard

Numbers = dict[str, Any]

EVERYWHERE: Numbers = {  # sections 3 and 4, algorithms 1 and 2, appendix B.2
    "ppo.objective": "clipped",
    "ppo.clip_range": 0.2,
    "ppo.minibatch_size": 64,
    "ppo.learning_rate": 3e-4,
    "ppo.gae_lambda": 0.95,
    "ppo.advantages": "after",
    "transfer.representation": 1,
    "transfer.instance": 1,
    "transfer.alpha_1": 1.0,  # it names one learning rate
    "transfer.alpha_2": 1.0,
    "transfer.kickstart_coef": 0.2,
    "transfer.kickstart_decay": 0.95,
    "transfer.kickstart_schedule": "geometric",
    "transfer.kickstart_counts": "iterations",
    "transfer.teacher_min_std": 0.0,
    "transfer.teacher_temperature": 1.0,
    "transfer.importance": True,
    "ppo.kl_over": "max",
    "select.rule": "zeta",
    "select.scale": "none",
    "select.loss_scale": "raw",
}
"""The teacher acts and is imitated as it was trained; ζ and L_ins meet raw advantages."""

MUJOCO: Numbers = {  # table 3
    "ppo.n_steps": 2048, "ppo.n_epochs": 10, "ppo.gamma": 0.99, "ppo.ent_coef": 1e-4,
}  # fmt: skip
DEEPRACER: Numbers = {  # table 4, section 6.3, appendix B.1
    "ppo.n_episodes": 20, "ppo.n_epochs": 8, "ppo.gamma": 0.999, "ppo.ent_coef": 1e-3,
    "transfer.teacher_episodes": 2, "select.threshold": 0.2, "net.conv": "3-layer", "net.pool": 1,
    "eval.episodes": 5, "eval.noise": "paper",
}  # fmt: skip
PAPER: Mapping[str, Numbers] = {
    "mujoco": MUJOCO,
    "reacher": MUJOCO | {"select.threshold": 0.8, "transfer.iterations": 15, "eval.episodes": 20},
    "ant": MUJOCO | {"transfer.iterations": 50, "eval.episodes": 5, "ppo.n_iterations": 1000},
    "single-car": DEEPRACER | {"transfer.iterations": 4},
    "multi-car": DEEPRACER | {"transfer.iterations": 20},
    "starcraft": {  # table 5
        "ppo.n_episodes": 2,
        "ppo.n_epochs": 6,
        "ppo.gamma": 0.99,
        "ppo.ent_coef": 0.01,
        "ppo.learning_rate": 3e-5,
        "transfer.teacher_episodes": 2,
        "transfer.iterations": 25,
        "transfer.kickstart_coef": 0.1,
        "select.threshold": 0.2,
    },
}
"""By platform, in addition to what holds everywhere."""

COACH_EVERYWHERE: Numbers = {
    "ppo.time_limit": "terminal",
    "ppo.vf_coef": 1.0,
    "ppo.advantages": "before",
    "select.scale": "teacher-batch",  # advantages are standardised before anything sees them
    "select.loss_scale": "selected",
    "select.min_samples": 64,  # fewer are no minibatch
}
COACH_MUJOCO: Numbers = {
    "ppo.clip_decay": 488,  # 10⁶ steps of 2,048 an iteration
    "ppo.whole_episodes": True,
    "ppo.n_envs": 1,  # whose episodes follow one another, so that the last one is cut
    "net.hidden": (64, 64),
    "net.activation": "tanh",
    "net.log_std_init": 0.0,
    "net.obs_normalize": True,
    "net.obs_clip": 5.0,
    "net.obs_min_std": 0.1,
}
COACH_CAMERA: Numbers = {"net.dense": 512, "net.shared": False}
COACH: Mapping[str, Numbers] = {
    "mujoco": COACH_MUJOCO, "reacher": COACH_MUJOCO, "ant": COACH_MUJOCO,
    "single-car": COACH_CAMERA, "multi-car": COACH_CAMERA, "starcraft": {},
}  # fmt: skip
"""By platform: what RL Coach's clipped PPO does, and its samples for MuJoCo and DeepRacer set."""


def paper_numbers(card: "TaskCard") -> dict[str, Any]:
    """Return what the paper's text says for a card's platform, by setting."""
    return {**EVERYWHERE, **PAPER.get(card.env.platform or "", {})}


def coach_numbers(card: "TaskCard") -> dict[str, Any]:
    """Return what RL Coach does on a card's platform, by setting."""
    platform = card.env.platform
    return {**COACH_EVERYWHERE, **COACH.get(platform or "", {})} if platform else {}


def sources(card: "TaskCard") -> Iterator[tuple[str, str]]:
    """Yield each setting of a card, and whose number it is: "paper", "Coach" or "ours"."""
    paper, coach = paper_numbers(card), coach_numbers(card)
    for name, value in settings_of(card).items():
        if name in paper and _same(paper[name], value):
            yield name, "paper"
        else:
            yield name, "Coach" if name in coach and _same(coach[name], value) else "ours"


def _same(one: Any, other: Any) -> bool:
    return list(one) == list(other) if isinstance(one, tuple) else bool(one == other)
