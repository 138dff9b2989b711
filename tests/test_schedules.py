import pytest

from repaint_cli.learn.transfer.schedules import (
    alphas,
    clip_range,
    kickstart_coefs,
    learning_rate,
    phase,
    threshold,
)
from repaint_cli.settings import PPOConfig
from repaint_cli.tasks.methods import METHODS
from repaint_cli.tasks.transfer_settings import SelectConfig, TransferConfig

LETTERS = {"ppo": "p", "critic": "c", "representation": "R", "instance": "I", "joint": "J"}


def phases(n, **settings):
    transfer = TransferConfig().model_copy(update=settings)
    return "".join(LETTERS[phase(k, transfer)] for k in range(1, n + 1))


@pytest.mark.parametrize(
    ("representation", "instance", "expected"),
    [(1, 1, "RIRIRIpp"), (2, 1, "RRIRRIpp"), (1, 2, "RIIRIIpp"), (1, 0, "RRRRRRpp")],
)
def test_the_ratio_is_the_order_until_k_iterations_are_done(representation, instance, expected):
    ratio = {"representation": representation, "instance": instance}
    assert phases(8, iterations=6, **ratio) == expected


def test_joint_does_both_in_every_iteration():
    assert phases(5, iterations=3, joint=True) == "JJJpp"
    assert phases(5, iterations=3, joint=True, instance=0) == "RRRpp"


def test_without_a_cross_entropy_representation_iterations_are_ppo():
    assert phases(5, iterations=4, kickstart_coef=0) == "pIpIp"


def test_no_transfer_iterations_is_ppo():
    assert phases(3, iterations=0) == phases(3, iterations=0, joint=True) == "ppp"


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("scratch", "pppp"),
        ("warm-start", "pppp"),
        ("kickstart", "RRRp"),
        ("instance", "pIpp"),
        ("repaint", "RIRp"),
        ("repaint-joint", "JJJp"),
    ],
)
def test_each_method_is_its_phases(method, expected):
    transfer = METHODS[method].apply(TransferConfig(iterations=3))
    assert phases(4, **transfer.model_dump()) == expected


def betas(n, n_teachers=1, **settings):
    transfer = TransferConfig(**settings)
    rows = [kickstart_coefs(k, transfer, n_teachers) for k in range(1, n + 1)]
    return [beta for (beta,) in rows] if n_teachers == 1 else rows


def test_beta_starts_at_beta_0_decays_each_iteration_and_ends_with_the_transfer():
    found = betas(5, iterations=3, kickstart_coef=0.2, kickstart_decay=0.5)
    assert found == pytest.approx([0.2, 0.1, 0.05, 0, 0])


def test_beta_decays_in_instance_iterations_too():
    # the paper's 15 Reacher iterations: 0.2·0.95¹⁴, although only 8 of them use β
    assert betas(15)[14] == pytest.approx(0.0975, abs=1e-4)


def test_beta_may_decay_with_representation_iterations_alone():
    settings = {"iterations": 6, "kickstart_decay": 0.5, "kickstart_counts": "representation"}
    # R I R I R I: one, one, two, two, three iterations of representation before
    assert betas(6, **settings) == pytest.approx([0.2, 0.1, 0.1, 0.05, 0.05, 0.025])
    assert betas(15, kickstart_counts="representation")[14] == pytest.approx(0.1397, abs=1e-4)


@pytest.mark.parametrize(
    ("schedule", "expected"),
    [
        ("geometric", [0.4, 0.2, 0.1, 0.05, 0]),
        ("linear", [0.4, 0.3, 0.2, 0.1, 0]),
        ("constant", [0.4, 0.4, 0.4, 0.4, 0]),
        ("stepwise", [0.4, 0.4, 0.2, 0.2, 0]),
    ],
)
def test_schedules_of_beta_by_hand(schedule, expected):
    settings = {"iterations": 4, "kickstart_coef": 0.4, "kickstart_decay": 0.5}
    found = betas(5, kickstart_schedule=schedule, kickstart_every=2, **settings)
    assert found == pytest.approx(expected)


def test_teachers_share_one_beta_evenly_or_have_one_each():
    one = betas(2, 2, kickstart_coef=0.2, kickstart_decay=0.5)
    assert one == [pytest.approx((0.1, 0.1)), pytest.approx((0.05, 0.05))]
    each = betas(2, 2, kickstart_coef=(0.2, 0.1), kickstart_decay=0.5)
    assert each == [pytest.approx((0.2, 0.1)), pytest.approx((0.1, 0.05))]


def test_zeta_moves_in_a_straight_line_to_its_last_value_at_k():
    transfer, select = TransferConfig(iterations=5), SelectConfig(threshold=0.8, last_threshold=0)
    found = [threshold(k, select, transfer) for k in range(1, 6)]
    assert found == pytest.approx([0.8, 0.6, 0.4, 0.2, 0])
    assert threshold(4, SelectConfig(threshold=0.8), transfer) == 0.8
    assert threshold(1, select, TransferConfig(iterations=1)) == 0.8


def test_both_alphas_follow_the_power_law_and_their_quotient_stays():
    transfer = TransferConfig(iterations=9, alpha_1=2, alpha_2=1, alpha_power=0.5)
    assert alphas(1, transfer) == (2, 1)
    assert alphas(4, transfer) == (1, 0.5)
    assert alphas(10, transfer)[0] == 1  # what remains is PPO


def test_clip_range_and_learning_rate_fall_to_nothing_where_asked():
    config = PPOConfig(clip_range=0.2, clip_decay=4, learning_rate=1.0, learning_rate_decay=2)
    assert [clip_range(k, config) for k in range(1, 6)] == pytest.approx([0.2, 0.15, 0.1, 0.05, 0])
    assert [learning_rate(k, config) for k in range(1, 6)] == pytest.approx([1, 0.5, 0, 0, 0])
    assert clip_range(99, PPOConfig()) == PPOConfig().clip_range
    assert learning_rate(99, PPOConfig()) == PPOConfig().learning_rate


def test_the_critic_may_learn_alone_before_the_rounds_begin():
    assert phases(8, iterations=6, critic_warmup=2) == "ccRIRIpp"
    assert phases(4, iterations=1, critic_warmup=3) == "cccp"
