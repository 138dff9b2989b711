import pytest

from repaint_cli.config import TransferConfig
from repaint_cli.learn.schedules import kickstart_coef, phase
from repaint_cli.methods import METHODS

LETTERS = {"ppo": "p", "representation": "R", "instance": "I", "joint": "J"}


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


def test_beta_starts_at_beta_0_decays_each_iteration_and_ends_with_the_transfer():
    transfer = TransferConfig(iterations=3, kickstart_coef=0.2, kickstart_decay=0.5)
    betas = [kickstart_coef(k, transfer) for k in range(1, 6)]
    assert betas == pytest.approx([0.2, 0.1, 0.05, 0, 0])


def test_beta_decays_in_instance_iterations_too():
    # the paper's 15 Reacher iterations: 0.2·0.95¹⁴, although only 8 of them use β
    assert kickstart_coef(15, TransferConfig()) == pytest.approx(0.0975, abs=1e-4)
