"""The build order: from observations only, and how many marines it makes in our simulator."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from repaint_cli.envs.starcraft.build_order import BuildOrder
from repaint_cli.envs.starcraft.build_timeline import Event, timelines
from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    DEPOT,
    MARINE,
)
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.rts.maps import BUILD_MARINES, BUILD_MARINES_FDZ

DOCS = Path(__file__).parents[1] / "docs"
MINES = replace(BUILD_MARINES, scv_after_build="mine")


@lru_cache
def played(scvs, barracks, spec=MINES):
    return timelines(MiniRTS(spec, 1), scvs, barracks, width=spec.camera.width)


def first(events, what):
    return next(event.loop for event in events if event.what == what)


@pytest.mark.parametrize(
    ("scvs", "barracks", "marines", "tolerance"),
    [(20, 7, 129, 5), (24, 8, 138, 4), (16, 6, 120, 5)],
)
def test_it_makes_as_many_marines_as_bots_of_the_same_size_do_in_the_game(
    scvs, barracks, marines, tolerance
):
    events = played(scvs, barracks)
    assert events[-1].loop == 14_400
    assert events[-1].what == "end"
    assert abs(events[-1].number - marines) <= tolerance
    assert max(event.number for event in events if event.what == "barracks") == barracks


def test_the_manuals_say_how_many_marines_it_makes():
    page = " ".join((DOCS / "starcraft-real.md").read_text(encoding="utf-8").split())
    waits, mines = played(20, 7, BUILD_MARINES)[-1].number, played(20, 7)[-1].number
    assert f"it ends with {waits} marines; where they go back to mine" in page
    assert f'(`env.scv_after_build = "mine"`), with {mines}.' in page
    page = " ".join((DOCS / "starcraft.md").read_text(encoding="utf-8").split())
    assert f"with 20 SCVs and 7 barracks builds {mines} marines here" in page
    assert f"(`env.scv_after_build=mine`), and {waits} where they wait" in page


def test_things_come_one_after_the_other_as_long_as_they_take():
    events = played(20, 7)
    depot, barracks, marine = (
        first(events, what) for what in ("supply depot", "barracks", "marine")
    )
    assert 768 - 16 <= depot <= 768 + 40  # a model without walking has it at 768
    assert 0 <= barracks - depot - BARRACKS.build_loops <= 120
    assert marine - barracks >= MARINE.build_loops
    assert [event.number for event in events if event.what == "supply depot"][:3] == [1, 2, 3]
    assert events == sorted(events, key=lambda event: event.loop)
    assert depot > DEPOT.build_loops


def test_every_click_hits_and_every_command_is_available():
    engine = MiniRTS(BUILD_MARINES, 1)
    engine.reset(np.array([3]))
    seen, sums = engine.observe(), np.zeros(8)
    order = BuildOrder(seen)
    for _ in range(600):
        terms, _, _ = engine.step(order.act(seen)[None])
        seen = engine.observe(None, seen)
        sums += terms[0]
    assert (sums[0], sums[2]) == (0, 0)
    assert sums[3] > 300


def test_builders_are_clicked_where_they_mine_and_it_still_makes_marines():
    engine = MiniRTS(replace(BUILD_MARINES, camera=BUILD_MARINES_FDZ.camera), 1)
    engine.reset(np.array([3]))
    seen = engine.observe()
    order = BuildOrder(seen, 32, 4, BUILD_MARINES_FDZ.camera.width, by_miners=True)
    clicks, sums, before = [], np.zeros(8), None
    for _ in range(1800):
        action = order.act(seen)
        if action[0] in (BUILD_DEPOT, BUILD_BARRACKS):
            clicks.append(before[1:])
        terms, _, _ = engine.step(action[None])
        seen, before = engine.observe(None, seen), action
        sums += terms[0]
    assert len(clicks) > 12
    assert (np.ptp(clicks, axis=0) <= 6).all()  # pixels: near one place, whatever is to be built
    assert (sums[0], sums[2]) == (0, 0)
    page = " ".join((DOCS / "starcraft.md").read_text(encoding="utf-8").split())
    assert f"the script it imitates, in our simulator | {sums[6]:.0f} |" in page


def test_the_timeline_of_an_engine_that_builds_nothing_is_its_end():
    class Idle:
        def __init__(self):
            self.mini, self.steps = MiniRTS(BUILD_MARINES, 1), 0

        def reset(self, seeds, rows=None):
            self.mini.reset(seeds)

        def observe(self, rows=None, out=None):
            return self.mini.observe()

        def step(self, actions, playing=None):
            self.steps += 1
            ended = np.array([self.steps == 5])
            return np.zeros((1, 8), np.float32), np.array([False]), ended

    assert timelines(Idle(), width=24) == [Event(40, "end", 0)]
