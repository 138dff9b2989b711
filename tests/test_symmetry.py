"""Symmetries: maps of observations and actions, arrays and tensors; simulators without any."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_array_equal

from repaint_cli.envs.simulator import Simulator
from repaint_cli.symmetry import SignedPermutation, Symmetry

REST = {"channels": None, "beams": None, "odd": frozenset()}


def as_both(array):
    return array, torch.from_numpy(array)


def test_a_signed_permutation_says_where_each_number_comes_from_and_its_sign():
    swap = SignedPermutation.of([2, 1, -3])
    assert swap == ((1, 0, 2), (1, 1, -1))
    for x in as_both(np.arange(12, dtype=np.float32).reshape(2, 2, 3)):
        before = x.tolist()
        mapped = swap(x)
        assert mapped.dtype == x.dtype
        assert mapped[1, 0].tolist() == [7, 6, -8]
        assert_array_equal(swap(mapped), before)
        assert_array_equal(x, before)  # left as it was


@pytest.mark.parametrize("of", ["numpy", "torch"])
def test_the_identity_returns_equal_numbers_in_new_memory(of):
    x = as_both(np.ones((2, 3)))[of == "torch"]
    mapped = SignedPermutation.identity(3)(x)
    mapped[0, 0] = 5
    assert x[0, 0] == 1


@pytest.mark.parametrize(
    ("numbers", "is_one"),
    [([1, -2], True), ([-2, -1], True), ([2, -1], False), ([2, 3, 1], False), ([3, 4], False)],
)
def test_which_maps_are_involutions(numbers, is_one):
    assert SignedPermutation.of(numbers).is_involution == is_one


def test_gradients_flow_through_a_map():
    x = torch.ones(2, requires_grad=True)
    (SignedPermutation.of([2, -1])(x) * torch.tensor([3.0, 5.0])).sum().backward()
    assert x.grad.tolist() == [-5, 3]


def test_images_are_flipped_and_their_channels_change_places():
    pair = Symmetry("mirrored", SignedPermutation.identity(1), None, **REST | {"channels": (1, 0)})
    for images in as_both(np.arange(24, dtype=np.uint8).reshape(1, 3, 4, 2)):
        mirrored = pair.observe(images)
        assert mirrored.shape == images.shape
        assert mirrored.dtype == images.dtype
        assert_array_equal(mirrored[0, 1, 0], images[0, 1, 3].tolist()[::-1])
        assert_array_equal(pair.observe(mirrored), images)
        one = images[..., :1]
        single = Symmetry("mirrored", pair.actions, None, **REST | {"channels": (0,)})
        assert_array_equal(single.observe(one)[0, 2, :, 0], one[0, 2, :, 0].tolist()[::-1])


def test_a_cars_camera_and_lidar_are_mirrored_by_name():
    car = Symmetry(
        "mirrored", SignedPermutation.identity(1), None, (0,), beams=(2, 1, 0), odd=frozenset()
    )
    camera = np.arange(4, dtype=np.uint8).reshape(1, 2, 2, 1)
    for images, ranges in zip(as_both(camera), as_both(np.array([[1.0, 2, 3]])), strict=True):
        mirrored = car.observe({"camera": images, "lidar": ranges})
        assert mirrored["camera"].ravel().tolist() == [1, 0, 3, 2]
        assert mirrored["lidar"].tolist() == [[3, 2, 1]]


def test_whole_numbers_are_numbered_actions_and_others_vectors():
    numbered = Symmetry("mirrored", SignedPermutation((2, 1, 0), (1, 1, 1)), None, **REST)
    for actions in as_both(np.array([[0, 1], [2, 2]])):
        assert numbered.act(actions).tolist() == [[2, 1], [0, 0]]
    vector = Symmetry("mirrored", SignedPermutation.of([2, 1, -3]), None, **REST)
    for actions in as_both(np.array([[1.0, 2, 3]])):
        assert vector.act(actions).tolist() == [[2, 1, -3]]


def test_the_parity_of_a_term():
    terms = Symmetry("m", SignedPermutation.identity(1), None, None, None, frozenset({"a"}),
                     frozenset({"b"}))  # fmt: skip
    assert [terms.parity(name) for name in "abc"] == [-1, None, 1]


def test_a_simulator_without_symmetries_says_so():
    class Still(Simulator):
        def make(self, n_envs, one_episode, noise, training=False):
            raise NotImplementedError

        def longest_episode(self):
            return 1

    still = Still(simulator="still")
    assert still.symmetries() == ()
    assert still.why_no_symmetry() == (
        "no symmetry of the simulator 'still' is known; a card can name one in its section "
        "[symmetry]"
    )
