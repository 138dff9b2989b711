"""Settings: frozen, explained, checked."""

from math import inf, nan

import pytest
from pydantic import ValidationError
from small_tasks import reach

from repaint_cli import settings
from repaint_cli.envs.gymnasium.simulator import GymnasiumSimulator
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.starcraft.simulator import StarCraftSimulator
from repaint_cli.errors import CardError
from repaint_cli.settings import PPOConfig, Settings
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS
from repaint_cli.tasks.transfer_settings import SelectConfig, TransferConfig
from repaint_cli.zoo.teacher_card import Score, TeacherCard

RECORDS = [part for part in vars(settings).values() if isinstance(part, type)]
RECORDS = [part for part in RECORDS if issubclass(part, Settings) and part is not Settings]
RECORDS += [GymnasiumSimulator, RacerSimulator, StarCraftSimulator]
RECORDS += [TaskCard, Score, TeacherCard]


@pytest.mark.parametrize("record", RECORDS)
def test_every_field_says_what_it_means(record):
    sentences = record.sentences()
    for name in record.model_fields:
        assert sentences.get(name, "").endswith("."), f"{record.__name__}.{name}"


@pytest.mark.parametrize("record", RECORDS)
def test_records_are_frozen_and_know_their_keys(record):
    assert record.model_config["frozen"]
    assert record.model_config["extra"] == "forbid"


@pytest.mark.parametrize("number", [nan, inf, -inf])
def test_no_setting_may_be_infinite_or_no_number(number):
    with pytest.raises(ValidationError, match="finite number"):
        SelectConfig(threshold=number)


@pytest.mark.parametrize(
    "wrong",
    [
        {"n_iterations": 0}, {"n_steps": 0}, {"n_episodes": 0}, {"n_envs": 0}, {"n_epochs": 0},
        {"minibatch_size": 0}, {"learning_rate": 0}, {"gamma": 0}, {"gamma": 1.01},
        {"gae_lambda": -0.1}, {"gae_lambda": 1.1}, {"clip_range": 0}, {"clip_range": 1},
        {"ent_coef": -1}, {"vf_coef": 0}, {"n_steps": None}, {"learning_rat": 1e-3},
    ],
)  # fmt: skip
def test_ppo_refuses(wrong):
    with pytest.raises(ValidationError):
        PPOConfig(**wrong)


@pytest.mark.parametrize(
    "wrong",
    [
        {"iterations": -1}, {"representation": 0}, {"instance": -1}, {"kickstart_coef": -0.1},
        {"kickstart_decay": 0}, {"kickstart_decay": 1.1}, {"alpha_1": 0}, {"alpha_2": -1},
        {"teacher_min_std": -1}, {"teacher_temperature": 0}, {"teacher_episodes": 0},
    ],
)  # fmt: skip
def test_transfer_refuses(wrong):
    with pytest.raises(ValidationError):
        TransferConfig(**wrong)


def test_a_joint_transfer_can_be_read_back_but_no_card_asks_for_one():
    joint = METHODS["repaint-joint"].apply(TransferConfig())
    assert TransferConfig.model_validate(joint.model_dump(mode="json")) == joint
    with pytest.raises(CardError, match=r"transfer\.joint: expected False; use --method repaint-j"):
        reach().with_settings(["transfer.joint=true"])


@pytest.mark.parametrize(
    ("method", "needs_teacher", "kickstart_coef", "instance", "joint"),
    [
        ("scratch", False, 0.0, 0, False),
        ("warm-start", True, 0.0, 0, False),
        ("kickstart", True, 0.3, 0, False),
        ("instance", True, 0.0, 2, False),
        ("repaint", True, 0.3, 2, False),
        ("repaint-joint", True, 0.3, 2, True),
    ],
)
def test_a_method_switches_off_what_it_leaves_out(
    method, needs_teacher, kickstart_coef, instance, joint
):
    left = METHODS[method].apply(TransferConfig(kickstart_coef=0.3, instance=2))
    assert METHODS[method].needs_teacher == needs_teacher
    assert (left.kickstart_coef, left.instance, left.joint) == (kickstart_coef, instance, joint)
