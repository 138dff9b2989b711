"""The reflections of some of Gymnasium's environments, by id."""

from collections.abc import Callable, Collection
from typing import NamedTuple

from repaint_cli.symmetry import SignedPermutation, Symmetry

# Vectors change signs as the coordinate that is reflected does; what turns (spins, torques, the
# vector of a quaternion) is reflected with all signs exchanged.
ACROSS, ALONG = (1, -1, 1), (-1, 1, 1)
"""Signs of x, y, z where left and right, and where front and back, change places."""


class Known(NamedTuple):
    """What is known of an environment."""

    symmetries: tuple[Symmetry, ...]
    """Its reflections."""
    kwargs: frozenset[str]
    """Arguments that change none of them."""


def symmetries_of(env_id: str, kwargs: Collection[str]) -> tuple[Symmetry, ...]:
    """Return the known reflections of an environment with arguments of these names."""
    known = _known(env_id)
    return known.symmetries if known and known.kwargs.issuperset(kwargs) else ()


def unknown_because(env_id: str, kwargs: Collection[str]) -> str | None:
    """Return why no symmetry of an environment is known, for people; None where one is."""
    known = _known(env_id)
    if known is None:
        what = f"no symmetry of {env_id} is known"
    elif changed := sorted(set(kwargs) - known.kwargs):
        what = f"the symmetries of {env_id} are known only without {', '.join(changed)}"
    else:
        return None
    return f"{what}; a card can name one in its section [symmetry]"


def _known(env_id: str) -> Known | None:
    return _KNOWN[env_id]() if env_id in _KNOWN else None


def _cartpole() -> Known:
    """Cart and pole at the other side: position, speed, angle and its speed change their signs."""
    mirror = Symmetry(
        "mirrored", SignedPermutation((1, 0), (1, 1)), SignedPermutation.of((-1, -2, -3, -4)),
        channels=None, beams=None, odd=frozenset(),
    )  # fmt: skip
    return Known((mirror,), frozenset({"sutton_barto_reward"}))


def _reacher() -> Known:
    """Angles and y change their signs: cos ×2, sin ×2, target x y, two spins, gap x y."""
    mirror = Symmetry(
        "mirrored", SignedPermutation.of((-1, -2)),
        SignedPermutation.of((1, 2, -3, -4, 5, -6, -7, -8, 9, -10)),
        channels=None, beams=None, odd=frozenset(),
    )  # fmt: skip
    return Known(
        (mirror,), frozenset({"frame_skip", "reward_dist_weight", "reward_control_weight"})
    )


def _ant() -> Known:
    """The legs, counted from 0, are at x, y of + +, − +, − −, + −."""
    left_right = _ant_in("mirrored", ACROSS, legs=(3, 2, 1, 0), ankle=1)
    front_back = _ant_in("front-back", ALONG, legs=(1, 0, 3, 2), ankle=-1)
    return Known(
        (left_right, front_back),
        frozenset({
            "frame_skip", "forward_reward_weight", "ctrl_cost_weight", "contact_cost_weight",
            "healthy_reward", "terminate_when_unhealthy", "healthy_z_range", "reset_noise_scale",
        }),
    )  # fmt: skip


def _ant_in(name: str, signs: tuple[int, int, int], legs: tuple[int, ...], ankle: int) -> Symmetry:
    """Return a reflection of the ant; hips turn about z.

    Args:
        name: of the reflection.
        signs: of x, y, z.
        legs: which leg each is in the mirror.
        ankle: the sign of an ankle's angle.
    """
    turning = tuple(-sign for sign in signs)
    joints, joint_signs = [2 * leg + j for leg in legs for j in (0, 1)], (turning[2], ankle) * 4
    bodies = [6 * (3 * leg + part) + j for leg in legs for part in range(3) for j in range(6)]
    order = [
        0, 1, 2, 3, 4, *(5 + j for j in joints),  # height, quaternion, angles
        *range(13, 19), *(19 + j for j in joints),  # velocity, spin, the joints' speeds
        *range(27, 33), *(33 + j for j in bodies),  # torque and force on the torso, on the legs
    ]  # fmt: skip
    each = [
        1, 1, *turning, *joint_signs, *signs, *turning, *joint_signs, *(*turning, *signs) * 13
    ]  # fmt: skip
    motors = (3, 0, 1, 2)  # the leg of each pair of motors
    places = [motors.index(legs[leg]) for leg in motors]
    torques = tuple(2 * place + j for place in places for j in (0, 1))
    lengthwise = signs[0] < 0
    return Symmetry(
        name, SignedPermutation(torques, joint_signs), SignedPermutation(tuple(order), tuple(each)),
        channels=None, beams=None,
        odd=frozenset(
            {"reward_forward", "x_velocity", "x_position"} if lengthwise
            else {"y_velocity", "y_position"}
        ),
        mixed=frozenset({"reward"} if lengthwise else ()),  # a sum with reward_forward in it
    )  # fmt: skip


_KNOWN: dict[str, Callable[[], Known]] = {
    "CartPole-v1": _cartpole, "Reacher-v5": _reacher, "Ant-v5": _ant,
}  # fmt: skip
