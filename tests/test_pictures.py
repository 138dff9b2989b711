"""Which numbers of an evaluation and of a training a picture or a table is made from."""

import json
from dataclasses import fields

import numpy as np
import pytest
from small_runs import log_of

from repaint_cli.cli.episode_table import cell
from repaint_cli.envs.episodes import Episodes
from repaint_cli.envs.racer import figures as racer_figures
from repaint_cli.envs.racer.deepracer.traces import Trace
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.runs import figures
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.runs.record import RunRecord
from repaint_cli.tasks.card_files import read_task

T, E = 4, 3
TASK = read_task("racer-inner")


@pytest.fixture
def plotted(monkeypatch):
    """The arguments of the drawing functions, by their names."""
    given = {}
    for name in ("plot_racer", "plot_heatmap", "plot_progress"):
        monkeypatch.setattr(
            racer_figures, name, lambda *args, name=name: given.update({name: args})
        )
    return given


def race():
    """One seed's race: a lap, a crash, an exit."""
    ends = [STATUS.index(name) for name in ("lap_complete", "crashed", "off_track")]
    records = {name: np.zeros((T, 1, E)) for name in TASK.env.records}
    records["status"][-1, 0] = ends
    records["speed"] += 0.7
    return Episodes(
        returns=np.ones((1, E)), lengths=np.full((1, E), T), terms=np.zeros((1, E, 1)),
        rewards=np.full((T, 1, E), -1.0), actions=np.zeros((T, 1, E), int), records=records,
        env_seeds=[0] * E, paths=np.zeros((1, E, T, 2)), targets=None,
    )  # fmt: skip


@pytest.mark.parametrize(("colour", "value"), [("speed", 0.7), ("reward", -1.0)])
def test_paths_have_the_colour_asked_for_and_their_ends(plotted, tmp_path, colour, value):
    assert figures.draw_trajectories(TASK, [("a", race())], tmp_path / "t.png", "t", colour)
    (paths,), *_, unit = plotted["plot_racer"]
    assert (paths.values == value).all()
    assert paths.values.shape == (E, T)
    assert unit.startswith(colour)
    assert len(paths.crashes) == len(paths.exits) == 1  # of the second and the third episode


def test_a_trainings_pictures_are_drawn_from_its_logs(plotted, tmp_path):
    nothing = {field.name: np.zeros(3) for field in fields(Trace)}
    ways = [
        Trace(
            **nothing | {"progress": np.array([1.0, 2.0, far]), "status": "off_track", "track": 0}
        )
        for far in (30.0, 50.0)
    ]
    log = log_of(TASK.env.logs.folders(tmp_path, [5])[0], TASK)
    log.train(1, ways[:1])
    log.train(3, ways[1:])
    record = RunRecord(seeds=[5, 6], method="scratch", teachers=[], task={})
    rows = {"eval_return": np.zeros((2, 3)), "eval_progress": np.array([[7.0, 8, 9], [0, 0, 0]])}
    drawn = figures.draw_training(RecordedRun(RunFolder(tmp_path), record, TASK, rows))
    assert [path.name for path in drawn] == ["heatmap.png", "progress.png"]
    drives, evaluated, *_ = plotted["plot_progress"]
    assert [(k, trace.progress[-1]) for k, trace in drives] == [(1, 30), (3, 50)]
    assert evaluated.tolist() == [7, 8, 9]
    assert plotted["plot_heatmap"][0] == drives
    assert json.loads((log.folder / "metrics" / "TrainingMetrics.json").read_text())
    rows["eval_progress"] = np.full((2, 3), np.nan)  # as in a damaged metrics.csv
    assert figures.draw_training(RecordedRun(RunFolder(tmp_path), record, TASK, rows)) == []


def test_the_table_has_laps_and_crashes_with_intervals():
    played = race()
    played.records["progress"][-1, 0] = [100, 40, 10]
    played.records["lap_time"][-1, 0] = [24.0, 9.0, 3.0]
    progress, whole, seconds, crashes = map(cell, TASK.env.columns(played, 0))
    assert progress.startswith("50 [10, ")
    assert (whole, seconds) == ("1 of 3", "24")
    assert crashes.startswith("33.3 [0, ")
