"""Weights of a reward function, fitted to what it pays; and the cars that wander for it."""

import json
import re

import numpy as np
import pytest
from small_runs import add_teacher

from repaint_cli.envs.racer.dynamics.car import commands_of
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.rules import LAP_COMPLETE, OFF_TRACK
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.wander import wander
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.reward_fit import fit, with_fitted_weights
from repaint_cli.tasks.similarity import cosine, relation

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

LANES = """
def reward_function(params):
    if params["is_offtrack"]:
        return 0.0
    return 2.0 if params["is_left_of_center"] else -2.0
"""
KEEP = """
def reward_function(params):
    room = params["track_width"] / 2 - params["distance_from_center"]
    kept = params["all_wheels_on_track"] and room >= 0.05
    return 1.5 * kept - 3.0 * (params["is_offtrack"] or params["is_crashed"])
"""
CENTRE = """
def reward_function(params):
    return 1 - params["distance_from_center"] / params["track_width"]
"""


def own_card(home, source, name="mine", base="racer-inner"):
    (home / "reward.py").write_text(source)
    (home / f"{name}.toml").write_text(
        f'extends = "{base}"\nsummary = "Mine."\n[reward]\nfunction = "reward.py"\n'
    )
    return f"{name}.toml"


@pytest.mark.parametrize("track", ["oval", "reinvent-like"])
def test_wandering_cars_see_the_whole_road_and_what_is_beside_it(track):
    road, env = load_track(track), read_task("racer-inner").env
    fleet = Fleet(road, 32, "sim4", 1500)
    gaps, ends, places = [], set(), []
    for rows, _, gained in wander(fleet, commands_of(env.actions), 150, seed=1):
        terms = fleet.terms(rows, gained)
        gaps.append(terms["lane"])
        ends |= set(fleet.status.tolist())
        places.append(fleet.lap_fractions.copy())
    lane = np.concatenate(gaps)
    assert min((lane > 0).mean(), (lane < 0).mean()) > 0.3
    assert OFF_TRACK in ends
    assert LAP_COMPLETE not in ends  # 150 steps are half a lap
    seen = np.histogram(np.concatenate(places), 20, (0, 1))[0]
    assert seen.min() > 0.3 * seen.mean()


def test_a_weighted_sum_is_found_again(home):
    found = fit(read_task(own_card(home, LANES)))
    assert found.r_squared == pytest.approx(1)
    assert found.weights == {"lane": pytest.approx(2), "keep": 0, "dprog": 0, "fail": 0}
    assert found.constant == pytest.approx(0, abs=1e-9)
    assert found.n_states == 16_000
    found = fit(read_task(own_card(home, KEEP, base="racer-avoid")))
    assert found.r_squared == pytest.approx(1)
    wanted = {"keep": pytest.approx(1.5), "fail": pytest.approx(-3)}
    others = dict.fromkeys(("lane", "dprog", "clear", "hazard", "camlane"), 0)
    assert found.weights == others | wanted


def test_a_constant_is_no_term(home):
    half = "def reward_function(params):\n    return 1.0 if params['is_left_of_center'] else 0.0"
    card = read_task(own_card(home, half))
    found = fit(card)
    assert found.weights == {"lane": pytest.approx(0.5, abs=0.01), "keep": 0, "dprog": 0, "fail": 0}
    assert found.constant == pytest.approx(0.5, abs=0.01)
    assert ", 0.5 always (R² 0.99" in str(found)
    plain, lanes = with_fitted_weights(card, found), read_task("racer-inner")
    assert cosine(plain, lanes) == pytest.approx(1)
    assert relation(lanes, plain) == "similar"


def test_what_the_function_prints_stays_out_of_the_answer(repaint, home):
    own_card(home, "print('loaded')\n" + LANES)
    said = repaint("similarity", "mine.toml", "racer-outer", "--json")
    assert json.loads(said.out)[0]["relation"] == "different"


def test_the_verdict_on_a_pair_does_not_depend_on_who_else_is_there(repaint, home):
    (home / "keep.toml").write_text(
        'extends = "racer-inner"\nsummary = "x"\n[reward]\nlane = 0\nkeep = 1\n'
    )
    own_card(home, LANES)
    alone = json.loads(repaint("similarity", "racer-inner", "keep.toml", "--json").out)
    among = json.loads(repaint("similarity", "racer-inner", "keep.toml", "mine.toml", "--json").out)
    assert alone[0] in among
    assert alone[0]["relation"] == "different, sub-task"


def test_bots_on_an_open_track_are_refused_here_too(repaint, home):
    line = np.stack([np.linspace(0, 6, 20), np.zeros(20)], axis=1)
    np.save(home / "lane.npy", np.hstack([line, line + [0, 0.4], line - [0, 0.4]]))  # noqa: RUF005
    own_card(home, LANES, base="racer-avoid")
    with (home / "mine.toml").open("a") as card:
        card.write('[env]\ntrack = "lane.npy"\n')
    said = repaint("similarity", "mine.toml")
    assert said.code == 3
    assert "[env]: expected a closed track for bots, found 'lane', an open one" in said.err


def test_the_same_function_always_weighs_the_same(home):
    card = read_task(own_card(home, KEEP))
    assert fit(card) == fit(card)


def test_similarity_fits_and_says_so(repaint, home):
    said = repaint("similarity", own_card(home, LANES), "racer-outer")
    assert said.code == 0
    assert "mine weighs lane 2, keep 0, dprog 0, fail 0 (R² 1.000 over 16,000 states)" in said.out
    assert "mine → racer-outer  -1.000  different" in said.out
    said = repaint("similarity", "mine.toml", "racer-outer", "--json")
    (pair,) = json.loads(said.out)
    assert pair["cosine"] == pytest.approx(-1)
    matrix = repaint("similarity", "mine.toml").out
    assert "racer-inner" in matrix
    assert "reacher" in matrix


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("def reward_function(params):\n    return 0.1", "of 'mine' always pays 0.1"),
        (CENTRE, r"nearly a weighted sum of lane, keep, dprog, fail \(R² of at least 0.9\), found"),
        ("def reward_function(params):\n    return 1", "of 'mine' always pays 1"),
        ("def reward_function(params):\n    return params['z']", "reward.py:2: KeyError: 'z'"),
    ],
)
def test_what_is_no_weighted_sum_is_refused(repaint, home, source, message):
    said = repaint("similarity", own_card(home, source), "racer-outer")
    assert said.code == 3
    assert ("mine weighs" in said.out) == (source is CENTRE)
    assert re.search(message, said.err)


def test_a_teachers_own_function_is_not_run(repaint, home):
    card = read_task(own_card(home, LANES))
    folder = home / "home" / "zoo"
    path = add_teacher(folder, "mine", "mine.toml", spaces_of(card))
    said = repaint("similarity", path.stem, "racer-outer")
    assert said.code == 3
    assert "'mine' was trained with the reward function reward.py, which is never run" in said.err
