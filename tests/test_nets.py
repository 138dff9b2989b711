import gymnasium.spaces as gym_spaces
import numpy as np
import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from small_learners import learn_on_policy
from torch import nn
from torch.testing import assert_close

from repaint_cli.errors import CardError
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.images import brightness
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.normalizer import Normalizer
from repaint_cli.policies.parameters import orthogonal
from repaint_cli.policies.spaces import Spaces
from repaint_cli.settings import PPOConfig

VECTOR = Spaces((3,), 2, discrete=False)
PICTURE = Spaces((24, 24, 1), 4, discrete=True)
RACER = Spaces((120, 160, 1), 10, discrete=True)
MLP = NetConfig(hidden=(8, 6))
CNN = NetConfig(kind="cnn", conv=((4, 4, 2), (8, 3, 1)), dense=16)
PAPER = NetConfig(kind="cnn")
KINDS = pytest.mark.parametrize(("spaces", "net"), [(VECTOR, MLP), (PICTURE, CNN)], ids=str)


def drawn(spaces, net, seeds=(0,)):
    student = ActorCritic(spaces, net, len(seeds))
    student.initialize([np.random.default_rng(seed) for seed in seeds])
    return student


def observations(spaces, n_seeds, n, seed=0):
    rng = np.random.default_rng(seed)
    shape = (n_seeds, n, *spaces.obs_shape)
    if spaces.image:
        return torch.from_numpy(rng.integers(0, 256, shape, dtype=np.uint8))
    return torch.from_numpy(rng.normal(size=shape).astype(np.float32))


def likelihoods(student, obs, counts=None):
    policy = student.policy(obs, counts)
    return policy.log_prob(policy.mode()) if student.spaces.image else policy.mean


def test_spaces_are_read_from_gymnasium():
    box = gym_spaces.Box(-1, 1, (3,))
    assert Spaces.of(box, gym_spaces.Box(-1, 1, (2,))) == VECTOR
    picture = gym_spaces.Box(0, 255, (24, 24, 1), np.uint8)
    assert Spaces.of(picture, gym_spaces.Discrete(4)) == PICTURE
    assert str(PICTURE) == "24×24×1 observations and 4 discrete actions"


@pytest.mark.parametrize(
    ("obs", "action"),
    [
        (gym_spaces.Discrete(3), gym_spaces.Discrete(4)),
        (gym_spaces.Box(0, 1, (3, 3)), gym_spaces.Discrete(4)),
        (gym_spaces.Box(0, 1, (3,)), gym_spaces.Discrete(4, start=1)),
        (gym_spaces.Box(0, 1, (3,)), gym_spaces.Box(-1, 1, (2, 2))),
        (gym_spaces.Box(0, 1, (3,)), gym_spaces.MultiBinary(4)),
    ],
)
def test_other_spaces_are_refused(obs, action):
    with pytest.raises(CardError, match="expected observations in a vector or an image"):
        Spaces.of(obs, action)


def test_a_network_of_the_wrong_kind_is_refused():
    with pytest.raises(CardError, match=r"net.kind 'mlp' reads a vector, the task gives 24×24×1"):
        ActorCritic(PICTURE, MLP, 1)
    with pytest.raises(CardError, match=r"net.kind 'cnn' reads an image, the task gives 3 obs"):
        ActorCritic(VECTOR, CNN, 1)


def test_an_image_too_small_for_its_convolutions_is_refused():
    with pytest.raises(CardError, match=r"layer 1 needs a larger image: 24×24×1 at net.pool 4"):
        ActorCritic(PICTURE, NetConfig(kind="cnn", pool=4, conv=((4, 4, 2), (8, 3, 1))), 1)


@KINDS
def test_weights_are_views_of_the_rows_and_so_are_their_gradients(spaces, net):
    student = drawn(spaces, net, seeds=(0, 1, 2))
    student.storage.fill_(7.0)
    student.gradients.fill_(9.0)
    for weight in student.weights.values():
        assert (weight == 7).all()
        assert (weight.grad == 9).all()
    assert sum(weight.numel() for weight in student.weights.values()) == student.storage.numel()


@KINDS
def test_the_first_part_of_a_row_is_the_policys_the_rest_the_critics(spaces, net):
    student = drawn(spaces, net, seeds=(0, 1))
    cut, obs = student.n_policy, observations(spaces, 2, 5)
    likelihoods(student, obs).sum().backward()
    assert student.gradients[:, :cut].any()
    assert not student.gradients[:, cut:].any()
    student.gradients.zero_()
    student.value(obs).sum().backward()
    assert not student.gradients[:, :cut].any()
    assert student.gradients[:, cut:].any()


@KINDS
def test_a_seeds_output_and_gradient_are_its_own(spaces, net):
    student, obs = drawn(spaces, net, seeds=(0, 1, 2)), observations(spaces, 3, 4)
    before, values = likelihoods(student, obs), student.value(obs)
    (likelihoods(student, obs)[1].sum() + student.value(obs)[1].sum()).backward()
    assert [bool(row.any()) for row in student.gradients] == [False, True, False]
    student.storage[1] += 1.0
    assert torch.equal(likelihoods(student, obs)[[0, 2]], before[[0, 2]])
    assert torch.equal(student.value(obs)[[0, 2]], values[[0, 2]])
    assert not torch.equal(student.value(obs)[1], values[1])


def test_dense_layers_are_those_of_torch():
    student, obs = drawn(VECTOR, MLP, seeds=(0, 1)), observations(VECTOR, 2, 5)
    for s in range(2):
        layers = []
        for name in ("value.0", "value.1", "value.head"):
            weight, bias = (student.weights[f"{name}.{part}"][s] for part in ("weight", "bias"))
            layer = nn.Linear(*weight.shape)
            layer.weight.data, layer.bias.data = weight.data.T, bias.data
            layers += [layer, nn.Tanh()]
        assert_close(nn.Sequential(*layers[:-1])(obs[s])[:, 0], student.value(obs)[s])


@pytest.mark.parametrize(
    ("activation", "layer"), [("tanh", nn.Tanh), ("relu", nn.ReLU), ("elu", nn.ELU)]
)
def test_policy_and_critic_may_differ_in_width_and_bend_otherwise(activation, layer):
    net = NetConfig(hidden=(8,), value_hidden=(7, 5), activation=activation)
    student, obs = drawn(VECTOR, net), observations(VECTOR, 1, 5)
    for tower, names in (("policy", ("0", "head")), ("value", ("0", "1", "head"))):
        layers = []
        for name in names:
            weight, bias = (
                student.weights[f"{tower}.{name}.{part}"][0] for part in ("weight", "bias")
            )
            linear = nn.Linear(*weight.shape)
            linear.weight.data, linear.bias.data = weight.data.T, bias.data
            layers += [linear, layer()]
        expected = nn.Sequential(*layers[:-1])(obs[0])
        found = student.policy(obs).mean if tower == "policy" else student.value(obs).unsqueeze(-1)
        assert_close(found[0], expected)


SHARED = pytest.mark.parametrize("shared", [False, True, "all"])


@SHARED
def test_the_camera_network_is_torchs(shared):
    student = drawn(PICTURE, CNN.model_copy(update={"shared": shared}), seeds=(0, 1))
    obs, w = observations(PICTURE, 2, 5), student.weights
    eyes, dense = "policy" if shared else "value", "policy" if shared == "all" else "value"
    for s in range(2):
        x = F.avg_pool2d(obs[s].permute(0, 3, 1, 2) / 255, 2)
        for layer, stride in (("conv0", 2), ("conv1", 1)):
            name = f"{eyes}.{layer}"
            x = F.relu(F.conv2d(x, w[f"{name}.weight"][s], w[f"{name}.bias"][s], stride))
        x = F.relu(x.flatten(1) @ w[f"{dense}.dense.weight"][s] + w[f"{dense}.dense.bias"][s])
        expected = x @ w["value.head.weight"][s] + w["value.head.bias"][s]
        assert_close(student.value(obs)[s], expected[:, 0])


def test_shared_convolutions_belong_to_the_policy_and_move_both():
    student = drawn(PICTURE, CNN.model_copy(update={"shared": True}))
    assert not [name for name in student.weights if name.startswith("value.conv")]
    obs = observations(PICTURE, 1, 3)
    values, policy = student.value(obs), likelihoods(student, obs)
    student.weights["policy.conv0.weight"].data += 0.1
    assert not torch.equal(student.value(obs), values)
    assert not torch.equal(likelihoods(student, obs), policy)


@SHARED
def test_policy_and_value_are_those_of_two_passes(shared):
    student = drawn(PICTURE, CNN.model_copy(update={"shared": shared}), seeds=(0, 1))
    obs, gradients = observations(PICTURE, 2, 5), []
    apart = student.policy(obs, [5, 3]), student.value(obs, [5, 3])
    for policy, values in (apart, student.policy_and_value(obs, [5, 3])):
        assert_close(values, apart[1])
        assert_close(policy.log_probs, apart[0].log_probs)
        student.gradients.zero_()
        (policy.log_probs[..., 0].sum() + values.sum()).backward()
        gradients.append(student.gradients.clone())
    assert_close(*gradients)
    assert (gradients[0] != 0).any(1).all()


def test_all_layers_but_the_heads_are_shared():
    student = drawn(PICTURE, CNN.model_copy(update={"shared": "all"}))
    names = [name for name in student.weights if name.startswith("value.")]
    assert names == ["value.head.weight", "value.head.bias"]


def test_images_beyond_the_count_are_not_looked_at():
    student, obs = drawn(PICTURE, CNN, seeds=(0, 1)), observations(PICTURE, 2, 4)
    other = obs.clone()
    other[0, 2:] = 255 - other[0, 2:]
    for look in (student.value, lambda *args: student.policy(*args).log_probs):
        assert torch.equal(look(obs, [2, 4]), look(other, [2, 4]))
        assert_close(look(obs, [2, 4])[0, :2], look(obs)[0, :2])
        assert_close(look(obs, [0, 4])[1], look(obs)[1])


@pytest.mark.parametrize("pool", [1, 2, 3])
@pytest.mark.parametrize("size", [(12, 18), (13, 19)], ids=["fits", "a rest is cut off"])
def test_brightness_is_average_pooling(pool, size):
    images = torch.randint(256, (3, *size, 2), dtype=torch.uint8)
    expected = F.avg_pool2d(images.permute(0, 3, 1, 2) / 255, pool)
    assert_close(brightness(images, pool), expected)


def test_brightness_goes_from_0_to_1():
    images = torch.tensor([0, 255], dtype=torch.uint8).reshape(2, 1, 1, 1).expand(2, 4, 4, 1)
    assert_close(brightness(images, 2).flatten(1), torch.tensor([[0.0] * 4, [1.0] * 4]))


@KINDS
def test_layers_start_orthogonal_with_small_policy_heads(spaces, net):
    student = drawn(spaces, net, seeds=(0, 1))
    for name, weight in student.weights.items():
        if not name.endswith("weight"):
            assert not weight.any()
            continue
        gain = {"policy.head.weight": 0.01, "value.head.weight": 1.0}.get(name, 2**0.5)
        for matrix in weight.detach().flatten(2):
            rows = matrix if len(matrix) <= matrix.shape[1] else matrix.T
            assert_close(rows @ rows.T, gain**2 * torch.eye(len(rows)), rtol=1e-4, atol=1e-6)


@KINDS
def test_a_seeds_first_parameters_do_not_depend_on_its_neighbours(spaces, net):
    together, alone = drawn(spaces, net, seeds=(3, 1, 2)), drawn(spaces, net, seeds=(1,))
    assert torch.equal(together.storage[1], alone.storage[0])
    assert not torch.equal(together.storage[0], together.storage[1])


@pytest.mark.parametrize(("pool", "millions"), [(2, 0.86), (1, 5.8)])
def test_size_of_the_racers_networks(pool, millions):
    student = ActorCritic(RACER, PAPER.model_copy(update={"pool": pool}), 1)
    assert student.n_policy / 1e6 == pytest.approx(millions, rel=0.01)
    assert student.storage.shape[1] == pytest.approx(2 * student.n_policy, rel=0.01)


def test_a_fresh_policy_has_sigma_1_and_hardly_prefers_anything():
    policy = drawn(VECTOR, MLP).policy(observations(VECTOR, 1, 50))
    assert_close(policy.log_std, torch.zeros(1, 1, 2))
    assert policy.mean.abs().max() < 0.05
    odds = drawn(PICTURE, CNN).policy(observations(PICTURE, 1, 50)).log_probs.exp()
    assert_close(odds, torch.full((1, 50, 4), 0.25), atol=0.01, rtol=0)


floats = st.floats(-9, 9, width=32)
chunk = st.integers(1, 9).flatmap(lambda n: arrays(np.float32, (n, 2), elements=floats))


@given(st.lists(chunk, min_size=1, max_size=5))
def test_statistics_are_those_of_all_observations_so_far(chunks):
    normalizer = Normalizer(2, 2)
    for chunk in chunks:
        normalizer.update(1, torch.from_numpy(chunk))
    everything = torch.from_numpy(np.concatenate(chunks)).double()
    assert_close(normalizer.mean[1], everything.mean(0))
    assert_close(normalizer.var[1], everything.var(0, correction=0))
    assert normalizer.count.tolist() == [0, len(everything)]
    assert_close(normalizer.mean[0], torch.zeros(2, dtype=torch.float64))


def test_statistics_of_numbers_far_from_zero_keep_their_spread():
    normalizer = Normalizer(1, 1)
    for _ in range(3):
        normalizer.update(0, torch.tensor([[1e6 - 1], [1e6 + 1]]))
    assert_close(normalizer.var[0], torch.ones(1, dtype=torch.float64))


def test_normalised_is_centred_scaled_and_clipped_at_five():
    normalizer = Normalizer(1, 1)
    normalizer.update(0, torch.tensor([[1.0], [5.0]]))  # mean 3, std 2
    found = normalizer.normalize(torch.tensor([[[3.0], [4.0], [-1.0], [99.0], [-99.0]]]))
    assert_close(found, torch.tensor([[[0.0], [0.5], [-2.0], [5.0], [-5.0]]]))


def test_a_number_that_hardly_varies_is_not_blown_up():
    normalizer = Normalizer(1, 1)
    normalizer.update(0, torch.full((9, 1), 2.0))
    assert_close(normalizer.normalize(torch.tensor([[[2.01]]])), torch.tensor([[[0.1]]]))


def test_a_card_says_how_far_normalised_numbers_go_and_the_least_deviation():
    obs = torch.tensor([[[2e6, -9.0]]])
    for clip, expected in ((3.0, [3.0, -3.0]), ("none", [2e6, -9.0])):
        network = ActorCritic(Spaces((2,), 1, False), NetConfig(obs_clip=clip), 1)
        assert network.normalizer.normalize(obs).tolist() == [[expected]]


def test_numbers_that_hardly_vary_around_a_large_mean_are_normalised_exactly():
    normalizer = Normalizer(1, 1, clip=10.0, min_std=0.0)
    mean, var = 1000.1, 1e-4  # in single precision the mean alone would be off by 0.0024 σ
    normalizer.mean[:], normalizer.var[:] = mean, var
    normalizer.load({"mean": normalizer.mean, "var": normalizer.var, "count": torch.ones(1)})
    obs = torch.tensor([[[1000.125]]])
    expected = (obs.double() - normalizer.mean) / normalizer.var.sqrt()
    found = normalizer.normalize(obs)
    assert found.dtype == torch.float32
    assert_close(found, expected.float(), rtol=1e-6, atol=0)


def test_a_card_may_leave_vectors_as_they_are():
    net = NetConfig(obs_normalize=False, obs_min_std=20.0)
    network = ActorCritic(Spaces((2,), 1, False), net, 2)
    network.normalizer.update(1, torch.tensor([[3.0, 1.0], [5.0, 1.001]]))
    obs = torch.tensor([[[2e6, -9.0]], [[1e-9, 0.1]]], dtype=torch.float64)
    for one in (network, network.alone(1)):
        part = obs[: one.n_seeds]
        assert torch.equal(one.normalizer.normalize(part), part.float())
        assert one.normalizer.narrow_features() == {}
    assert network.normalizer.count.tolist() == [0, 0]


def test_before_the_first_update_observations_pass():
    assert_close(Normalizer(1, 1).normalize(torch.tensor([[[0.7]]])), torch.tensor([[[0.7]]]))


def test_loaded_statistics_are_used():
    first, second = Normalizer(1, 2), Normalizer(1, 2)
    first.update(0, torch.randn(20, 2) * 4 + 1)
    second.load({"mean": first.mean, "var": first.var, "count": first.count})
    obs = torch.randn(1, 5, 2)
    assert torch.equal(second.normalize(obs), first.normalize(obs))
    first.update(0, torch.randn(20, 2))
    assert second.count.item() == 20


STEREO = Spaces((120, 160, 2), 10, discrete=True, n_beams=64)
DEEP = {
    "3-layer": ((32, 14, 19), (64, 6, 8), (64, 4, 6)),
    "4-layer": ((32, 28, 38), (32, 26, 36), (64, 12, 17), (64, 10, 15)),
    "5-layer": ((32, 58, 78), (64, 28, 38), (64, 26, 36), (128, 12, 17), (128, 10, 15)),
}
"""What the layers of the paper's camera networks put out, at 60 × 80 pixels: (C, H, W)."""


def sights(n):
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (1, n, *STEREO.obs_shape), dtype=np.uint8)
    ranges = rng.uniform(0.12, 1, (1, n, 64)).astype(np.float32)
    return {"camera": torch.from_numpy(images), "lidar": torch.from_numpy(ranges)}


@pytest.mark.parametrize("name", DEEP)
def test_the_papers_camera_networks_are_torchs(name):
    student, obs = drawn(STEREO, NetConfig(kind="cnn", conv=name)), sights(3)
    shape, weights = NetConfig(kind="cnn", conv=name).conv_torso, student.weights
    bend = torch.tanh if name == "4-layer" else torch.relu
    x = F.avg_pool2d(obs["camera"][0].permute(0, 3, 1, 2) / 255, 2)
    for layer, ((_, _, stride), size) in enumerate(zip(shape.layers, DEEP[name], strict=True)):
        w, b = (weights[f"value.conv{layer}.{part}"][0] for part in ("weight", "bias"))
        x = bend(F.conv2d(x, w, b, stride))
        assert x.shape == (3, *size)

    def dense(x, layer):
        return x @ weights[f"value.{layer}.weight"][0] + weights[f"value.{layer}.bias"][0]

    x = x.flatten(1)
    if name == "4-layer":
        x = torch.tanh(dense(x, "embed"))
        assert x.shape == (3, 64)
    near = torch.relu(dense(torch.relu(dense(1 - obs["lidar"][0], "lidar0")), "lidar1"))
    x = torch.relu(dense(torch.cat([x, near], 1), "dense"))
    assert_close(student.value(obs)[0], dense(x, "head")[:, 0])


def test_the_three_layers_by_name_are_the_default():
    assert NetConfig(kind="cnn", conv="3-layer").conv_torso == NetConfig(kind="cnn").conv_torso


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("name", ["4-layer", "5-layer"])
def test_a_deeper_network_learns_in_every_layer(name, shared):
    student = drawn(STEREO, NetConfig(kind="cnn", conv=name, shared=shared))
    start, n = student.storage.clone(), 6
    obs = sights(n)
    store = {part: array[0] for part, array in obs.items()}
    policy = student.policy(obs)
    actions = policy.mode()
    samples = Samples(
        observations=Observations([store]), rows=torch.arange(n)[None], actions=actions,
        behavior_log_probs=policy.log_prob(actions).detach(), advantages=torch.randn(1, n),
        returns=torch.randn(1, n), rewards=torch.zeros(1, n), counts=torch.tensor([n]),
    )  # fmt: skip
    ppo = PPOConfig(n_epochs=1, minibatch_size=n)
    optimizer = RowAdam(student, ppo.learning_rate)
    learn_on_policy(student, optimizer, samples, ppo, [np.random.default_rng(0)])
    assert torch.isfinite(student.storage).all()
    moved = student.storage != start
    begin = 0
    for leaf in student.leaves:
        size = int(np.prod(leaf.shape))
        assert moved[0, begin : begin + size].any(), leaf.name
        begin += size


@pytest.mark.parametrize("shape", [(4200, 256), (100, 11264)], ids=["tall", "wide"])
def test_a_large_layer_starts_as_orthogonal_as_a_small_one(shape):
    drawn = orthogonal(np.random.default_rng(0), shape, 2.0)
    long = np.random.default_rng(0).standard_normal((max(shape), min(shape)))
    q, r = np.linalg.qr(long)
    expected = 2 * q * np.sign(np.diag(r))
    assert_allclose(drawn if shape[0] > shape[1] else drawn.T, expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("spaces", [Spaces((5,), 3, False), Spaces((40, 40, 2), 3, True, 8)])
def test_uniform_first_weights_are_those_of_pytorch(spaces):
    """Uniform on ±1/√(inputs), weights and biases, as `torch.nn.Linear` and `Conv2d` begin."""
    kind = "cnn" if spaces.image else "mlp"
    net = NetConfig(kind=kind, init="uniform", log_std_init=-2.0, conv=((8, 8, 4), (8, 3, 1)))
    network = ActorCritic(spaces, net, 2)
    network.initialize([np.random.default_rng(s) for s in range(2)])
    torch.manual_seed(0)
    for name, weight in network.weights.items():
        values = weight.detach()
        if name == "policy.log_std":
            assert (values == -2.0).all()
            continue
        shape = network.weights[f"{name.rpartition('.')[0]}.weight"].shape[1:]
        own = (
            torch.nn.Linear(*shape) if len(shape) == 2
            else torch.nn.Conv2d(shape[1], shape[0], shape[2:])
        )  # fmt: skip
        theirs = getattr(own, name.rpartition(".")[2]).detach()
        bound = 1 / np.sqrt(own.weight[0].numel())
        assert float(values.abs().max()) <= bound
        if values.numel() > 300:
            assert float(values.std()) == pytest.approx(float(theirs.std()), rel=0.1)
            assert float(values.abs().max()) > 0.98 * bound
        assert not torch.equal(values[0], values[1])
