"""A step equals a slow, obvious one; games do not know of each other; bad actions are named."""

from dataclasses import replace

import numpy as np
import pytest
from starcraft_bots import WAIT, BuildingBot
from starcraft_reference_fights import FightingGame

from repaint_cli.envs.starcraft.rts.constants import SELECT_POINT, TERMS
from repaint_cli.envs.starcraft.rts.engine import MiniRTS, Observation
from repaint_cli.envs.starcraft.rts.maps import (
    BUILD_MARINES,
    BUILD_MARINES_FDZ,
    FIND_AND_DEFEAT_ZERGLINGS,
    MAPS,
    Rectangle,
)
from repaint_cli.envs.starcraft.rts.state import State, bytes_of

SPECS = list(MAPS.values())


def random_actions(rng, n):
    return np.stack([rng.integers(0, high, n) for high in (7, 84, 84)], axis=1)


def useful_actions(rts, rng):
    """Random commands, of those that are available, at places where something is."""
    actions = random_actions(rng, rts.n)
    for row in range(rts.n):
        game = rts.state.arrays[row]
        if rng.random() < 0.9:
            actions[row, 0] = rng.choice(np.flatnonzero(game["available"]))
        if actions[row, 0] == SELECT_POINT and rng.random() < 0.8:
            things = [(game[f"{kind}_x"][k], game[f"{kind}_y"][k])
                      for kind, there in (("scv", "scv_state"), ("barracks", "barracks_done"))
                      for k in np.flatnonzero(game[there])]  # fmt: skip
            things.append((rts.world["centre_x"][0], rts.world["centre_y"][0]))
            x, y = things[rng.integers(len(things))]
            column = (x - rts.world["left"][0]) / rts.world["pixel"][0]
            row_ = (rts.world["top"][0] - y) / rts.world["pixel"][0]
            actions[row, 1:] = np.clip((column, row_), 0, 83)
    return actions


def prepared(name):
    """A game in which much can happen, by name."""
    spec = {
        "base": replace(BUILD_MARINES, scv_after_build="mine", minerals=120),
        "larger map": BUILD_MARINES_FDZ,
        "fights": replace(FIND_AND_DEFEAT_ZERGLINGS, ends_without_marines=False),
    }[name]
    rts = MiniRTS(spec, 1)
    rts.reset(np.array([5]))
    if name != "fights":
        rts.state.minerals[0] = 2000
    if name == "larger map":
        rng, s = np.random.default_rng(0), rts.state
        s.marine_hp[0, :30], s.army_count[0], s.food_used[0] = 45, 30, 42
        s.food_cap[0] = 100
        s.marine_x[0, :30], s.marine_y[0, :30] = rng.uniform(44, 60, (2, 30))
        s.marine_hp[0, :10] = 5
    return rts


@pytest.mark.parametrize("name", ["base", "larger map", "fights"])
def test_a_step_equals_the_reference_over_500_random_steps(name):
    rts, rng = prepared(name), np.random.default_rng(3)
    reference = FightingGame(rts.state.arrays[0], rts.world[0])
    for k in range(500):
        (action,) = useful_actions(rts, rng)
        rts.step(action[None])
        if not (reference.terminated or reference.truncated):
            reference.step(*action.tolist())
        if k % 7 == 0 or k > 490:
            for field in rts.state.arrays.dtype.names:
                found = getattr(rts.state, field)[0]
                wanted = getattr(reference, field)
                np.testing.assert_array_equal(found, wanted, f"{field} after step {k}")
    happened = {name for name, count in rts.stats().items() if count[0]}
    assert (
        happened
        >= {
            "base": {"depots_built", "barracks_built", "marines_built", "scvs_trained"},
            "larger map": {"depots_built", "zerglings_killed", "marines_died"},
            "fights": {"zerglings_killed"},
        }[name]
    )


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.name)
def test_a_game_is_the_same_bytes_alone_in_a_batch_and_with_threads(spec):
    many, two, alone = MiniRTS(spec, 64), MiniRTS(spec, 64, threads=2), MiniRTS(spec, 1)
    seeds = np.arange(64) * 7
    for rts, own in ((many, seeds), (two, seeds), (alone, seeds[17:18])):
        rts.reset(own)
    rng = np.random.default_rng(0)
    for _ in range(60):
        actions = random_actions(rng, 64)
        many.step(actions)
        two.step(actions)
        alone.step(actions[17:18])
    assert many.state.arrays.tobytes() == two.state.arrays.tobytes()
    assert many.state.arrays[17].tobytes() == alone.state.arrays[0].tobytes()
    for a, b in zip(many.observe(), two.observe(), strict=True):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(many.observe(np.array([17])), alone.observe(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_other_seeds_are_other_games():
    rts = MiniRTS(FIND_AND_DEFEAT_ZERGLINGS, 3)
    rts.reset(np.array([1, 2, 1]))
    assert rts.state.arrays[0].tobytes() == rts.state.arrays[2].tobytes()
    assert (rts.state.zergling_x[0] != rts.state.zergling_x[1]).any()


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.name)
def test_a_game_goes_on_from_a_snapshot_as_it_went(spec):
    rts, rng = MiniRTS(spec, 4), np.random.default_rng(0)
    rts.reset(np.arange(4))
    actions = [random_actions(rng, 4) for _ in range(40)]
    for k in range(20):
        rts.step(actions[k])
    kept = rts.snapshot()
    seen = rts.observe()
    for k in range(20, 40):
        rts.step(actions[k])
    after = rts.snapshot()
    rts.restore(kept)
    for a, b in zip(rts.observe(), seen, strict=True):
        np.testing.assert_array_equal(a, b)
    for k in range(20, 40):
        rts.step(actions[k])
    assert rts.snapshot().tobytes() == after.tobytes()
    other = MiniRTS(spec, 1)  # one game, elsewhere
    other.restore(kept[2:3], np.array([0]))
    for k in range(20, 40):
        other.step(actions[k][2:3])
    assert other.snapshot().tobytes() == after[2:3].tobytes()


def test_games_of_some_rows_begin_anew_and_others_stay():
    rts = MiniRTS(BUILD_MARINES, 3)
    rts.reset(np.arange(3))
    rts.step(np.tile(WAIT, (3, 1)))
    before = rts.snapshot()
    rts.reset(np.array([9]), np.array([1]))
    assert rts.state.loop.tolist() == [8, 0, 8]
    np.testing.assert_array_equal(bytes_of(rts.snapshot())[[0, 2]], bytes_of(before)[[0, 2]])


def test_a_game_that_is_not_active_stands_still():
    rts = MiniRTS(BUILD_MARINES, 2)
    rts.reset(np.arange(2))
    before = rts.snapshot()
    phi, _, _ = rts.step(np.tile(WAIT, (2, 1)), np.array([True, False]))
    assert rts.state.loop.tolist() == [8, 0]
    assert rts.snapshot()[1].tobytes() == before[1].tobytes()
    assert phi[0].any()
    assert not phi[1].any()


@pytest.mark.parametrize(("spec", "steps"), list(zip(SPECS, (1800, 1800, 360), strict=True)))
def test_a_game_is_truncated_at_its_last_loop_and_then_stands_still(spec, steps):
    rts = MiniRTS(spec, 1)
    rts.reset(np.zeros(1, int))
    assert spec.steps == steps
    rts.state.loop[0] = spec.loops - 16
    for wanted in (False, True, True):
        phi, terminated, truncated = rts.step(np.array([WAIT]))
        assert (terminated[0], truncated[0]) == (False, wanted)
    assert rts.state.loop[0] == spec.loops == steps * 8
    assert not phi.any()


def test_terms_add_up_to_what_is_counted():
    rts = MiniRTS(replace(BUILD_MARINES, minutes=4.0), 2)
    rts.reset(np.arange(2))
    players, total = [BuildingBot(rts, row, 16, 4) for row in range(2)], np.zeros((2, 8))
    done = np.zeros(2, bool)
    while not done.all():
        phi, _, done = rts.step(np.array([player.action() for player in players]))
        assert phi.dtype == np.float32
        total += phi
    counts = rts.stats()
    for term in set(TERMS) & set(counts):
        np.testing.assert_array_equal(total[:, TERMS.index(term)], counts[term])
    assert len(set(TERMS) & set(counts)) == 5
    assert (counts["marines_built"] > 0).all()
    assert not counts["marines_died"].any()


def test_observations_are_written_into_arrays_that_are_given():
    rts = MiniRTS(BUILD_MARINES, 3)
    rts.reset(np.arange(3))
    out = Observation.empty(2)
    assert rts.observe(np.array([2, 0]), out) is out
    np.testing.assert_array_equal(out.screen, rts.observe().screen[[2, 0]])
    assert out.measurements.tolist() == [[50, 12, 15, 12, 0]] * 2


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ((7, 0, 0), "expected command from 0 to 6, found 7"),
        ((-1, 0, 0), "expected command from 0 to 6, found -1"),
        ((4, 84, 0), "expected x from 0 to 83, found 84"),
        ((4, 0, -3), "expected y from 0 to 83, found -3"),
        ((4, 0), r"expected actions \(1, 3\), found \(1, 2\)"),
    ],
)
def test_an_action_that_is_none_is_named(action, message):
    rts = MiniRTS(BUILD_MARINES, 1)
    rts.reset(np.zeros(1, int))
    with pytest.raises(ValueError, match=message):
        rts.step(np.array([action]))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"minerals": -1}, "expected minerals from 0 to 30000, found -1"),
        ({"start_scvs": 0}, "expected start_scvs from 1 to 64, found 0"),
        ({"zerglings": 41}, "expected zerglings from 0 to 40, found 41"),
        ({"minutes": 0}, "expected minutes from 0.01 to 1440.0, found 0"),
        ({"marines": -2}, "expected marines from 0 to 100, found -2"),
        ({"patches": ((1.0, 1.0),) * 9}, "expected at most 8 patches, found 9"),
        ({"region": Rectangle(3, 3, 4, 60)}, "expected a region of at least 2 × 2 units"),
        ({"region": Rectangle(3, 3, 66, 60)}, "expected a region of at least 2 × 2 units"),
        ({"camera": BUILD_MARINES.camera._replace(width=0.0)}, "expected a camera 1 to 256 units"),
    ],
)
def test_a_map_with_wrong_numbers_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        replace(BUILD_MARINES, **settings)


def test_seeds_and_rows_must_be_as_many():
    with pytest.raises(ValueError, match="expected 2 seeds"):
        MiniRTS(BUILD_MARINES, 2).reset(np.arange(3))


def test_rows_that_are_none_and_arrays_that_do_not_fit_are_named():
    rts = MiniRTS(BUILD_MARINES, 2)
    rts.reset(np.arange(2))
    with pytest.raises(ValueError, match="expected rows from 0 to 1, found 2"):
        rts.reset(np.array([5]), np.array([2]))
    with pytest.raises(ValueError, match="expected room for 2 games in screen"):
        rts.observe(out=Observation.empty(1))
    short = Observation.empty(2)._replace(available=np.zeros((2, 6), np.uint8))
    with pytest.raises(ValueError, match="expected room for 2 games in available"):
        rts.observe(out=short)


def test_a_field_that_is_none_is_named():
    with pytest.raises(AttributeError, match="a game has no array 'marine_z'"):
        _ = State(1).marine_z
