"""The reflections of Gymnasium's environments: a step from any state, and that in the mirror."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from repaint_cli.envs.gymnasium.simulator import GymnasiumSimulator
from repaint_cli.policies.spaces import Spaces
from repaint_cli.symmetry import SignedPermutation

N_STEPS = 1000
TOLERANCE = 1e-9
ANT_LEGS = {"mirrored": {1: 4, 2: 3, 3: 2, 4: 1}, "front-back": {1: 2, 2: 1, 3: 4, 4: 3}}


def simulator(env_id, **kwargs):
    return GymnasiumSimulator(simulator="gymnasium", id=env_id, kwargs=kwargs)


# -- states in the mirror, by what they mean; each sets a state, drawn anew, and returns it


def cartpole_states(env, rng):
    """Often near the ends, so that episodes end."""
    return rng.uniform(-1, 1, 4) * [2.5, 2, 0.25, 2]


def set_cartpole(env, state):
    env.unwrapped.state = state
    env.unwrapped.steps_beyond_terminated = None


def cartpole_in_mirror(env, state, name):
    return -state


def reacher_states(env, rng):
    qpos = np.concatenate([rng.uniform(-np.pi, np.pi, 2), rng.uniform(-0.2, 0.2, 2)])
    return qpos, np.concatenate([rng.uniform(-5, 5, 2), [0, 0]])


def set_mujoco(env, state):
    env.unwrapped.set_state(*state)
    env.unwrapped.data.qacc_warmstart[:] = 0  # the solver would begin at the last step's forces


def reacher_in_mirror(env, state, name):
    qpos, qvel = state
    return qpos * [-1, -1, 1, -1], -qvel


def ant_states(env, rng):
    """What an episode of random actions leads to: in the air, and on the ground."""
    inner = env.unwrapped
    if rng.integers(50) == 0 or not inner.is_healthy:
        env.reset(seed=int(rng.integers(10**6)))
    return inner.data.qpos.copy(), inner.data.qvel + rng.normal(0, 0.3, 14)


def ant_in_mirror(env, state, name):
    """Reflect x or y; joints by their names: hips turn about z, ankles are at 45° to x and y."""
    (qpos, qvel), lengthwise = state, name == "front-back"
    direct = np.array([-1, 1, 1] if lengthwise else [1, -1, 1])
    mirrored_qpos, mirrored_qvel = qpos.copy(), qvel.copy()
    mirrored_qpos[:3] *= direct
    mirrored_qpos[4:7] *= -direct
    mirrored_qvel[:3] *= direct
    mirrored_qvel[3:6] *= -direct
    model = env.unwrapped.model
    for joint, sign in (("hip", -1), ("ankle", -1 if lengthwise else 1)):
        for leg, partner in ANT_LEGS[name].items():
            to, source = model.joint(f"{joint}_{leg}"), model.joint(f"{joint}_{partner}")
            mirrored_qpos[to.qposadr] = sign * qpos[source.qposadr]
            mirrored_qvel[to.dofadr] = sign * qvel[source.dofadr]
    return mirrored_qpos, mirrored_qvel


HOW = {
    "CartPole-v1": (cartpole_states, set_cartpole, cartpole_in_mirror),
    "Reacher-v5": (reacher_states, set_mujoco, reacher_in_mirror),
    "Ant-v5": (ant_states, set_mujoco, ant_in_mirror),
}
CASES = [("CartPole-v1", "mirrored"), ("Reacher-v5", "mirrored"), ("Ant-v5", "mirrored"),
         ("Ant-v5", "front-back")]  # fmt: skip


def symmetry_of(env_id, name):
    (found,) = (s for s in simulator(env_id).symmetries() if s.name == name)
    return found


def step(env, set_state, state, action):
    """Set a state, act, and return all that comes of it."""
    set_state(env, state)
    obs, reward, terminated, _, info = env.step(action)
    numbers = {name: float(value) for name, value in info.items() if np.ndim(value) == 0}
    return obs.astype(float), numbers | {"reward": float(reward)}, terminated


def pairs(env_id, name, symmetry, n_steps):
    """Yield steps and the same in the mirror, whose action the symmetry says."""
    states, set_state, in_mirror = HOW[env_id]
    env, mirror = gymnasium.make(env_id), gymnasium.make(env_id)
    env.reset(seed=0)
    mirror.reset(seed=0)
    env.action_space.seed(0)
    rng = np.random.default_rng(0)
    for _ in range(n_steps):
        state, action = states(env, rng), np.asarray(env.action_space.sample())
        reflected = step(mirror, set_state, in_mirror(env, state, name), symmetry.act(action))
        yield step(env, set_state, state, action), reflected


@pytest.fixture(scope="module", params=CASES, ids=" ".join)
def played(request):
    env_id, name = request.param
    symmetry = symmetry_of(env_id, name)
    return env_id, symmetry, list(pairs(env_id, name, symmetry, N_STEPS))


def observed(played):
    """Observations of all steps, and of the same in the mirror, (N_STEPS, O) each."""
    return (np.array([two[i][0] for two in played]) for i in (0, 1))


def test_a_step_in_the_mirror_is_the_mirror_image_of_the_step(played):
    _, symmetry, steps = played
    obs, reflected = observed(steps)
    assert np.abs(symmetry.observe(obs) - reflected).max() < TOLERANCE
    assert [one[2] for one, _ in steps] == [other[2] for _, other in steps]


def test_terms_stay_or_change_their_sign_as_the_symmetry_says(played):
    _, symmetry, steps = played
    names = steps[0][0][1].keys()
    assert symmetry.odd <= names
    for name in names:
        one, other = (np.array([two[i][1][name] for two in steps]) for i in (0, 1))
        parity = symmetry.parity(name)
        if parity is None:
            assert not np.allclose(one, other)
            assert not np.allclose(one, -other)
        else:
            assert np.abs(parity * one - other).max() < TOLERANCE, name
            assert np.abs(one).max() > 1e-3, f"{name} is always 0, so that any sign would do"


def test_each_kind_of_end_is_among_the_steps(played):
    env_id, _, steps = played
    ends = {one[2] for one, _ in steps}
    assert ends == ({False} if env_id == "Reacher-v5" else {False, True})


def test_every_wrong_sign_of_an_observation_is_seen(played):
    _, symmetry, steps = played
    obs, reflected = observed(steps)
    order, signs = symmetry.vector
    for i in np.flatnonzero(np.abs(obs).max(0) > 0):  # of the ground's forces many are always 0
        wrong = SignedPermutation(order, (*signs[:i], -signs[i], *signs[i + 1 :]))
        seen = replace(symmetry, vector=wrong).observe(obs)
        assert np.abs(seen - reflected).max() > 1e-3, i


def test_every_wrong_sign_of_an_action_is_seen(played):
    env_id, symmetry, _ = played
    order, signs = symmetry.actions
    if env_id == "CartPole-v1":
        wrongs = [SignedPermutation((0, 1), signs)]
    else:
        flipped = [(*signs[:i], -signs[i], *signs[i + 1 :]) for i in range(len(signs))]
        wrongs = [SignedPermutation(order, each) for each in flipped]
    for wrong in wrongs:
        acting = replace(symmetry, actions=wrong)
        obs, reflected = observed(list(pairs(env_id, symmetry.name, acting, 20)))
        assert np.abs(symmetry.observe(obs) - reflected).max() > 1e-3


@pytest.mark.parametrize("env_id", HOW)
def test_symmetries_are_reflections_of_the_environments_spaces(env_id):
    env = gymnasium.make(env_id)
    spaces = Spaces.of(env.observation_space, env.action_space)
    for symmetry in simulator(env_id).symmetries():
        assert symmetry.actions.is_involution
        assert symmetry.vector.is_involution
        assert len(symmetry.vector.order) == spaces.obs_shape[0]
        assert len(symmetry.actions.order) == spaces.n_actions
    assert simulator(env_id).why_no_symmetry() is None


@pytest.mark.parametrize(
    ("env", "why"),
    [
        (simulator("HalfCheetah-v5"), "no symmetry of HalfCheetah-v5 is known"),
        (simulator("Ant-v4"), "no symmetry of Ant-v4 is known"),
        (
            simulator("Ant-v5", include_cfrc_ext_in_observation=False, frame_skip=2),
            "the symmetries of Ant-v5 are known only without include_cfrc_ext_in_observation",
        ),
    ],
    ids=["other", "older", "arguments"],
)
def test_where_no_symmetry_is_known_a_line_says_why(env, why):
    assert env.symmetries() == ()
    assert env.why_no_symmetry() == f"{why}; a card can name one in its section [symmetry]"


def test_arguments_that_change_no_symmetry_leave_it():
    env = simulator("Ant-v5", forward_reward_weight=2.0, healthy_z_range=[0.3, 1.0])
    assert len(env.symmetries()) == 2
