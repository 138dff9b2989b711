import numpy as np
import pytest
import torch

from repaint_cli.learn.rollout.observations import BLOCK, Observations, ObservationStore, each


@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
def test_a_store_holds_what_it_was_given_in_order_however_often_it_grows(dtype):
    rng, store = np.random.default_rng(0), ObservationStore(np.zeros((2, 4, 3, 5), dtype))
    pieces = [
        rng.integers(0, 255, (k, 3, 5)).astype(dtype) for k in (1, 0, 7, BLOCK, 2 * BLOCK + 9, 3)
    ]
    for piece in pieces:
        store.append(piece)
        piece += 1  # what was stored is a copy
    kept = store.tensor()
    assert kept.dtype == (torch.uint8 if dtype == np.uint8 else torch.float32)
    np.testing.assert_array_equal(kept.numpy(), np.concatenate(pieces) - 1)


def test_a_store_of_nothing_is_empty():
    assert ObservationStore(np.zeros((1, 1, 6))).tensor().shape == (0, 6)


def test_what_was_given_away_cannot_move_any_more():
    store = ObservationStore(np.zeros((1, 1, 2)))
    store.append(np.ones((3, 2)))
    kept = store.tensor()
    with pytest.raises(AttributeError):
        store.append(np.zeros((BLOCK, 2)))
    assert (kept == 1).all()


def test_each_seed_has_stores_of_its_own_by_name():
    obs = {"camera": np.zeros((2, 3, 4, 4, 1), np.uint8), "lidar": np.zeros((2, 3, 8))}
    stores = [each(ObservationStore, obs) for _ in range(2)]
    stores[0]["lidar"].append(np.ones((5, 8)))
    observations = Observations([each(ObservationStore.tensor, store) for store in stores])
    assert [len(store["lidar"]) for store in observations.stores] == [5, 0]
