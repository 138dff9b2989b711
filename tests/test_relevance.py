import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.rollout.transitions import Transitions
from repaint_cli.learn.transfer.relevance import relevance
from repaint_cli.tasks.transfer_settings import SelectConfig


def moves(*batches):
    """Transitions of rows (s, a, s′, r), one batch per seed; s, a and s′ are single numbers."""
    tables = [np.array(batch, float) for batch in batches]
    counts = torch.tensor([len(table) for table in tables])
    longest = int(counts.max())

    def padded(column):
        rows = [np.pad(table[:, column], (0, longest - len(table))) for table in tables]
        return torch.tensor(np.array(rows), dtype=torch.float32)

    stores = [
        torch.tensor(np.concatenate([table[:, 0], table[:, 2]])[:, None], dtype=torch.float32)
        for table in tables
    ]
    rows = torch.arange(longest).expand(len(tables), -1)
    here = rows.clamp(max=counts[:, None] - 1)
    return Transitions(
        Observations(stores), here, here + counts[:, None], padded(1)[..., None],
        padded(3), torch.zeros(rows.shape).bool(), counts,
    )  # fmt: skip


def by_loops(target, source, select):
    """Compliance and relevance as the formulas are written, point by point."""
    units = [np.std(column, axis=0) for column in (target[:, :2], target[:, 2] - target[:, 0])]
    units.append(np.std(target[:, 3]))
    parts = [
        (table[:, :2] / units[0], (table[:, 2] - table[:, 0]) / units[1], table[:, 3] / units[2])
        for table in (target, source)
    ]
    kernel = lambda x: np.exp(-(x**2) / select.bandwidth)  # noqa: E731
    n, m = len(target), len(source)
    far = np.array(
        [[np.linalg.norm(parts[0][0][i] - parts[1][0][j]) for j in range(m)] for i in range(n)]
    )

    def agreement(here, there, distances):
        found = []
        for i in range(len(distances)):
            w = kernel(distances[i]) / kernel(distances[i]).sum()
            moved = np.mean([w[j] * kernel(here[1][i] - there[1][j]) for j in range(len(w))])
            paid = np.mean([w[j] * kernel(here[2][i] - there[2][j]) for j in range(len(w))])
            found.append(moved * paid)
        return np.array(found)

    compliance = agreement(*parts, far).mean()
    lam = agreement(*parts[::-1], far.T)
    lam = lam / (lam.sum() if select.normalize == "sum" else lam.max())
    rel = []
    for j in range(m):
        w = kernel(far[:, j]) / kernel(far[:, j]).sum()
        order = np.argsort(far[:, j])[:: 1 if select.neighbours == "nearest" else -1]
        inside = [
            i for k, i in enumerate(order) if k == 0 or w[order[:k]].sum() < select.neighbourhood
        ]
        rel.append(np.exp(-(((lam[j] - 1) / far[inside, j].mean()) ** 2)))
    return compliance, np.array(rel)


@pytest.mark.parametrize("normalize", ["sum", "max"])
@pytest.mark.parametrize("neighbours", ["nearest", "farthest"])
def test_relevance_is_the_formulas(normalize, neighbours):
    rng = np.random.default_rng(0)
    target, *sources = (rng.normal(size=(n, 4)) for n in (9, 6, 4))
    select = SelectConfig(
        rule="rbt", bandwidth=0.7, neighbourhood=0.6, normalize=normalize, neighbours=neighbours
    )
    expected = [by_loops(target, source, select) for source in sources]
    total = sum(compliance for compliance, _ in expected)
    chances = np.concatenate([c / total * rel / rel.sum() for c, rel in expected])
    found = relevance(moves(target), [moves(source) for source in sources], select)
    assert_allclose(found[0], chances, rtol=1e-4)


def test_what_disagrees_with_the_targets_samples_nearby_is_irrelevant():
    target = [(x, 0.1 * i, x + 1, 5.0 + x) for i, x in enumerate(np.linspace(-1, 1, 9))]
    like, unlike = (0.0, 0.4, 1.0, 5.0), (0.0, 0.4, -1.0, -5.0)
    far = (9.0, 0.4, -1.0, -5.0)  # which nothing contradicts
    select = SelectConfig(rule="rbt", normalize="max", neighbourhood=0.1)
    agrees, disagrees, alone = relevance(moves(target), [moves([like, unlike, far])], select)[0]
    assert disagrees < 0.01 * agrees
    assert alone > 0.5 * agrees


def test_seeds_are_judged_one_by_one_and_may_have_unequal_numbers():
    rng = np.random.default_rng(1)
    target, source = (
        [rng.normal(size=(n, 4)) for n in (7, 5)],
        [rng.normal(size=(n, 4)) for n in (3, 6)],
    )
    select = SelectConfig(rule="rbt", bandwidth=1.0)
    both = relevance(moves(*target), [moves(*source)], select)
    for s, n in enumerate((3, 6)):
        alone = relevance(moves(target[s]), [moves(source[s])], select)
        assert_allclose(both[s, :n], alone[0], rtol=1e-5)
        assert both[s].sum() == pytest.approx(1)


def test_where_nothing_is_near_all_are_alike():
    target = moves([(0.1 * i, 0.1 * i, 0.2 * i, 0.3 * i) for i in range(5)])
    far = moves([(1e4 * i, 0.0, 0.0, 0.0) for i in range(5, 9)])
    found = relevance(target, [far], SelectConfig(rule="rbt"))[0]
    assert torch.isfinite(found).all()
    assert found.sum() == pytest.approx(1)
    assert (found > 0.2).all()
