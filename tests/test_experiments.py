"""Experiments: the shipped files, the schema, the runs they plan; nothing is trained here."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from small_experiment import small
from small_runs import add_teacher
from written_runs import climb, write_run

from repaint_cli.engines.options import EngineOptions
from repaint_cli.errors import CardError, CheckpointError, NotFound, StoreError
from repaint_cli.experiments import estimates, figures, planned, results
from repaint_cli.experiments.estimates import hours_of, seconds_left
from repaint_cli.experiments.files import list_experiments, read_experiment
from repaint_cli.experiments.folder import ExperimentFolder, ExperimentRecord, own_folder, record_of
from repaint_cli.experiments.measures import over_panels, rows_of, smoothed
from repaint_cli.experiments.planned import INTO, PlannedRun
from repaint_cli.experiments.planning import plan_experiment
from repaint_cli.experiments.results import COLUMNS, MeasuredPanel, read_curves, write_curves
from repaint_cli.experiments.tables import cells, markdown, nobody_reached, over_markdown, summary
from repaint_cli.files.paths import shipped
from repaint_cli.runs.estimate import Estimate
from repaint_cli.runs.plan import Plan
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.similarity import cosine
from repaint_cli.zoo.view_names import TeacherFile

ALL = {one.name: one for one in list_experiments()}
ITEMS = {
    "reacher": "figure 1", "reacher-selection": "figure 2", "reacher-rbt": "figure 3",
    "ant": "figure 4", "single-car": "figure 5", "trajectories": "figure 6",
    "multi-car": "figure 7", "table-1": "table 1", "ratio": "appendix C.1",
    "ant-zeta": "appendix C.2", "single-car-zeta": "appendix C.3",
    "single-car-beta": "appendix C.3", "single-car-beta-schedule": "appendix C.3",
    "multi-car-4-layer": "appendix C.4", "multi-car-5-layer": "appendix C.4",
    "wall-clock": "table 6", "starcraft": "figure 8",
}  # fmt: skip
"""What the paper has, but for pictures of environments."""

TABLE_1 = {
    ("reacher", 0): (71, 44, 76), ("reacher", 1): (58, 27, 71), ("ant", 0): (64, 38, 66),
    ("single-car", 0): (None, None, 28), ("single-car", 1): (None, None, 32),
    ("single-car", 2): (None, None, 28), ("single-car", 3): (None, None, 32),
    ("multi-car", 0): (66, 25, 71), ("multi-car", 1): (14, 31, 68), ("starcraft", 0): (3, 75, 94),
}  # fmt: skip
"""By experiment and panel, the percentages that the paper prints of KS, IT and REPAINT."""

TABLE_6 = {
    ("reacher", 0): (71.4, 47.6, 81.0), ("reacher", 1): (57.1, 33.3, 71.4),
    ("ant", 0): (58.1, 33.0, 60.7), ("single-car", 0): (None, None, 31.8),
    ("single-car", 1): (None, None, 34.8), ("single-car", 2): (None, None, 31.8),
    ("single-car", 3): (None, None, 34.8), ("multi-car", 0): (70.7, 23.2, 72.6),
    ("multi-car", 1): (3.1, 13.5, 61.5), ("starcraft", 0): (None, None, None),
}  # fmt: skip


def test_every_figure_and_table_of_the_paper_has_its_experiment():
    assert {one.name: one.item for one in ALL.values()} == ITEMS
    assert [one.name for one in list_experiments()][:3] == [
        "reacher", "reacher-selection", "reacher-rbt"
    ]  # fmt: skip


@pytest.mark.parametrize(("hours", "table", "digits"), [(False, TABLE_1, 0), (True, TABLE_6, 1)])
def test_the_paper_s_numbers_give_the_percentages_that_it_prints(hours, table, digits):
    found = {
        (one.name, n): tuple(
            None if share is None else round(100 * share + 1e-9, digits)
            for name in ("kickstart", "instance", "repaint")
            for share in [panel.paper.reduced(name, hours)]
        )
        for one in ALL.values() for n, panel in enumerate(one.panels) if panel.paper
    }  # fmt: skip
    assert found.keys() == table.keys()
    for key, shares in found.items():
        for ours, printed in zip(shares, table[key], strict=True):
            assert (ours is None) == (printed is None)
            assert ours is None or abs(ours - printed) <= (0.5 if digits == 0 else 0.06), key


@pytest.mark.parametrize("name", sorted(ALL))
def test_every_experiment_can_be_planned_at_its_scales(name, tmp_path):
    for scale in ALL[name].scale_names:
        check_plan(ALL[name], scale, tmp_path)


def check_plan(experiment, scale, tmp_path):
    planned = plan_experiment(experiment, scale, tmp_path)
    assert planned.panels
    assert planned.folder == tmp_path / scale / experiment.name
    for run in planned.runs():
        seeds = 2 if scale == "smoke" else len(run.seeds)
        assert run.seeds == tuple(range(seeds))  # 0-49 are for judging
        assert max(run.seeds) < 50
        if scale == "smoke":
            assert (run.card.ppo.n_iterations, run.card.ppo.n_epochs) == (2, 1)
            assert run.card.eval.episodes == 2
            assert run.card.net.kind == "mlp" or run.card.net.pool > 1  # smaller checkpoints
    assert 0 < seconds_left(planned.all_runs()) / 3600 < 200


def test_the_paper_s_settings_are_those_of_its_tables(tmp_path):
    wanted = {
        "reacher": (15, 0.8),
        "ant": (50, 0.8),
        "single-car": (4, 0.2),
        "multi-car": (20, 0.2),
        "starcraft": (25, 0.2),
    }
    for name, (k, zeta) in wanted.items():
        automatic = {variant.name for variant in ALL[name].variants if variant.auto}
        panels = plan_experiment(ALL[name], "paper", tmp_path).panels
        for run in (panel.runs[v] for panel in panels for v in panel.runs.keys() - automatic):
            transfer, select = run.card.transfer, run.card.select
            assert (transfer.iterations, select.threshold, select.scale) == (k, zeta, "none")
            coef = 0.1 if name == "starcraft" else 0.2
            assert (transfer.kickstart_coef, transfer.alpha_2) == (coef, 1)
            assert (transfer.representation, transfer.instance) == (1, 1)
            assert (transfer.alpha_1, run.card.ppo.advantages) == (1, "after")
            assert (transfer.teacher_min_std, transfer.teacher_temperature) == (0, 1)


def test_runs_that_experiments_share_have_one_folder(tmp_path):
    def runs(name):
        return {run.folder for run in plan_experiment(ALL[name], "paper", tmp_path).runs()}

    assert len(runs("reacher")) == 7  # one from scratch for both teachers
    assert len(runs("reacher-rbt") & runs("reacher")) == 3
    assert len(runs("ratio") & runs("reacher")) == 5
    assert len(runs("single-car-zeta") & runs("single-car")) == 4  # ζ 0.2 is the paper's
    assert len(runs("single-car-beta-schedule") & runs("single-car-beta")) == 4
    assert runs("wall-clock") >= runs("reacher") | runs("single-car")
    assert runs("table-1") == runs("wall-clock") | runs("starcraft")
    other = plan_experiment(ALL["reacher"], "night", tmp_path)
    assert not {run.folder for run in other.runs()} & runs("reacher")


def test_a_run_s_folder_is_another_where_anything_differs(tmp_path):
    planned = plan_experiment(ALL["ant"], "paper", tmp_path)
    run = planned.panels[0].runs["repaint"]
    (teacher,) = run.teachers
    card = run.card.with_settings(["ppo.gamma=0.98"])
    others = [
        replace(run, seeds=(0,)), replace(run, method="instance"), replace(run, card=card),
        replace(run, teachers=(replace(teacher, key="another"),)),
        replace(run, card=run.card.with_settings(["ppo.n_iterations=9"])),
    ]  # fmt: skip
    assert len({run.key, *(other.key for other in others)}) == 6
    assert replace(run, seconds=9.0).key == run.key
    other_words = run.card.model_copy(update={"summary": "The same in other words."})
    assert replace(run, card=other_words).key == run.key


def test_a_setting_with_its_default_is_not_part_of_a_run_s_key(tmp_path, monkeypatch):
    run = plan_experiment(ALL["reacher"], "paper", tmp_path).runs()[0]
    seen: list[dict[str, object]] = []
    monkeypatch.setattr(planned, "key_of", lambda what: seen.append(what) or "")
    assert run.key == ""
    assert run.card.ppo.kl_penalty == 0
    assert "kl_penalty" not in seen[0]["task"]["ppo"]
    assert "n_iterations" in seen[0]["task"]["ppo"]


def test_teachers_that_are_not_shipped_come_first(tmp_path):
    planned = plan_experiment(ALL["ant"], "paper", tmp_path)
    made = planned.teachers()
    assert [teacher.name for teacher in made] == [f"ant-forward-{n}" for n in (3, 5, 10)]
    assert [run.card.name for run in planned.all_runs()[:3]] == [t.name for t in made]
    assert all(min(teacher.run.seeds) >= 50 for teacher in made)
    assert {teacher.file.parent.parent for teacher in made} == {tmp_path / "teachers"}


def test_the_two_readings_of_the_penalty():
    inner, outer, soft_inner, soft_outer = (
        read_task(f"racer-{name}") for name in ("inner", "outer", "inner-soft", "outer-soft")
    )
    for soft, own in ((soft_inner, 1), (soft_outer, -1)):
        lane, keep = soft.reward["lane"], soft.reward["keep"]
        assert own * lane + keep == pytest.approx(1)  # a step in its own lane
        assert -own * lane + keep == pytest.approx(-0.1)  # a step in the other
    assert cosine(soft_inner, soft_outer) == pytest.approx(-0.198, abs=5e-4)
    assert cosine(inner, soft_outer) == pytest.approx(-0.774, abs=5e-4)
    assert cosine(outer, soft_inner) == pytest.approx(-0.774, abs=5e-4)


def test_a_teacher_of_the_hard_reading_teaches_the_soft_one():
    soft = read_task("racer-outer-soft")
    teacher = shipped("zoo") / "racer-inner.safetensors"
    _, teachers = Plan(soft, "repaint", [0], Path("run"), (TeacherFile(teacher),)).check()
    assert [card.name for card in teachers.cards] == ["racer-inner"]


BAD = [
    ('summary = "x"\nitem = "y"\npanels = []', "expected either panels or gathers"),
    (small(variants="[]"), "expected variants in panel 'one'"),
    (small(variants='["magic"]'), "expected a method (scratch, warm-start"),
    (small(variants='["scratch", "scratch"]'), "expected every variant once, found 'scratch'"),
    (small(variants='[{ name = "a,b", method = "scratch" }]'), 'expected a name without , " |'),
    (small().replace('teachers = ["old-hand"]', ""), "expected teachers for 'kickstart' in 'one'"),
    (small() + "seeds = 3", "unknown key 'panels.0.seeds'"),
    ("seeds =", "mine.toml"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "problem"), BAD)
def test_a_file_that_is_no_experiment_is_refused_in_a_line(home, text, problem):
    (home / "mine.toml").write_text(text)
    with pytest.raises(CardError) as caught:
        read_experiment("mine.toml")
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "kind", "problem"),
    [
        (small(variants='[{ name = "ζ 1", settings = ["select.treshold=1"] }]'), NotFound,
         "experiment 'mine', 'ζ 1': unknown setting 'select.treshold'; did you mean"),
        (small(variants='[{ name = "ζ 1", settings = ["select.share=3"] }]'), CardError,
         "experiment 'mine', 'ζ 1': task 'reacher': select.share: "),
        (small(teacher="nobody-at-all"), NotFound,
         "experiment 'mine', 'kickstart': unknown teacher 'nobody-at-all'"),
    ],
)  # fmt: skip
def test_a_sweep_or_a_teacher_that_cannot_be_is_found_before_training(home, text, kind, problem):
    add_teacher(home / "home" / "zoo")
    (home / "mine.toml").write_text(text)
    with pytest.raises(kind) as caught:
        plan_experiment(read_experiment("mine.toml"), "smoke", home / "into")
    assert problem in str(caught.value)
    assert not (home / "into").exists()


def a_panel(tmp_path, **speeds):
    """A measured panel of the experiment reacher, of runs that climb at some speeds."""
    runs = {
        name: write_run(tmp_path / name, climb(speed=speed), method=name)
        for name, speed in speeds.items()
    }
    return MeasuredPanel("reacher", ALL["reacher"].panels[0], runs)


def test_a_row_has_our_numbers_and_the_paper_s(tmp_path):
    rows = rows_of(a_panel(tmp_path, scratch=9.0, repaint=3.0))
    scratch, repaint = (cells(row) for row in rows)
    k, ours = rows[0].ours.reached, rows[1].ours.reached
    assert scratch[3] == f"{k:.0f} (173)"
    assert repaint[3] == f"{ours:.0f} (42)"
    assert scratch[4] == ""
    assert repaint[4] == f"{1 - ours / k:.0%} (76%)"
    assert repaint[5].endswith(" (-5.4)")
    assert scratch[5].endswith(" (-7.4)")
    assert repaint[8].endswith(" (0.4 h)")
    heads, (line,) = summary(rows, time=False)
    assert len(heads) == len(line) == 4
    assert line[1] == "-7.4 (-7.4)"
    assert line[3] == f"{ours:.0f}, {1 - ours / k:.0%} (42, 76%)"
    assert len(list(markdown(rows, "time"))) == 3


def test_a_target_that_nobody_reaches_is_said(tmp_path):
    panel = a_panel(tmp_path, scratch=9.0, repaint=3.0)
    high = replace(panel, panel=panel.panel.model_copy(update={"target": 100.0}))
    rows = rows_of(high)
    assert [cells(row)[3] for row in rows] == ["never (173)", "never (42)"]
    (said,) = nobody_reached(rows)
    assert "nobody reached the target 100 in 20 iterations; the best mean is -4" in said
    assert not nobody_reached(rows_of(panel))


def test_curves_are_read_as_they_were_written(tmp_path):
    (panel,) = [a_panel(tmp_path, scratch=9.0, kickstart=5.0, instance=4.0, repaint=3.0)]
    experiment = ALL["reacher"].model_copy(update={"panels": ALL["reacher"].panels[:1]})
    path = tmp_path / "curves.csv"
    write_curves([panel], path)
    (found,) = read_curves(path, experiment)
    assert list(found.runs) == list(panel.runs)
    for name, run in panel.runs.items():
        np.testing.assert_allclose(found.runs[name].returns, run.returns, rtol=1e-5)
        np.testing.assert_array_equal(found.runs[name].rows["env_steps"], run.rows["env_steps"])
    assert [cells(row) for row in rows_of(found)] == [cells(row) for row in rows_of(panel)]

    text = path.read_text()
    for changed, problem in (
        (text.replace("env_steps", "steps", 1), "expected one column 'env_steps'"),
        (text.replace(",repaint,", ",other,"), "has no 'repaint' in 'similar teacher"),
        (text.replace(",1000,", ",many,"), "is damaged: could not convert"),
        (text[: text.rindex("\n", 0, -1) + 1], "as many iterations of each seed of 'repaint'"),
    ):
        path.write_text(changed)
        with pytest.raises(CheckpointError) as caught:
            read_curves(path, experiment)
        assert problem in str(caught.value)
        assert "\n" not in str(caught.value)
    assert text.splitlines()[0] == ",".join(COLUMNS)


def test_figures_have_a_panel_a_task_and_are_the_same_every_time(tmp_path):
    panel = a_panel(tmp_path, scratch=9.0, repaint=3.0)
    folder = ExperimentFolder(tmp_path)
    written = figures.draw_curves(ALL["reacher"], [panel, panel], folder, "3 seeds", "night")
    assert [path.name for path in written] == [
        "iterations.png", "iterations.svg", "steps.png", "steps.svg"
    ]  # fmt: skip
    before = [path.read_bytes() for path in written]
    figures.draw_curves(ALL["reacher"], [panel, panel], folder, "3 seeds", "night")
    assert [path.read_bytes() for path in written] == before
    text = folder.figure("iterations", ".svg").read_text()
    assert "smoothed over 3 iterations" in text
    assert "target -7.4" in text


def test_smoothing_averages_what_is_there():
    curve = np.array([[1.0, 4.0, 1.0, 4.0, np.nan]])
    np.testing.assert_allclose(smoothed(curve, 3), [[2.5, 2.0, 3.0, 2.5, 4.0]])
    assert smoothed(curve, 1) is curve


def test_a_folder_of_another_experiment_is_not_written(home):
    add_teacher(home / "home" / "zoo")
    (home / "mine.toml").write_text(small())
    planned = plan_experiment(read_experiment("mine.toml"), "smoke", home / "into")
    own_folder(planned, replace=False)
    assert not ExperimentRecord.read(own_folder(planned, replace=False).record).finished
    edited = small(target=3, variants='["scratch"]')
    (home / "mine.toml").write_text(edited)
    own_folder(plan_experiment(read_experiment("mine.toml"), "smoke", home / "into"), replace=False)
    (home / "mine.toml").write_text(edited.replace("A small", "Quite another"))
    other = plan_experiment(read_experiment("mine.toml"), "smoke", home / "into")
    with pytest.raises(StoreError, match=r"mine is of another experiment, A small experiment\.; "):
        own_folder(other, replace=False)
    own_folder(other, replace=True)
    record = planned.folder / "experiment.json"
    record.write_text(record.read_text().replace('"schema_version": 1', '"schema_version": 9'))
    with pytest.raises(CheckpointError, match="another version of repaint: expected schema_vers"):
        own_folder(other, replace=False)
    record.unlink()
    Path(planned.folder / "notes.txt").write_text("mine")
    with pytest.raises(StoreError, match="is there and is no experiment's"):
        own_folder(other, replace=False)


def test_hours_are_those_of_runs_that_are_trained_once():
    scale = ALL["reacher"].scale("paper")
    wanted = 7 * (scale.seeds * scale.iterations * scale.seconds + 5) / 3600
    assert hours_of(ALL["reacher"], "paper") == pytest.approx(wanted)


def test_an_iteration_that_nobody_has_timed_is_measured_once_a_task(tmp_path, monkeypatch):
    measured = []

    def estimate(plan):
        measured.append((plan.task.name, plan.method, plan.seeds))
        return Estimate((3.0,), plan.task.ppo.n_iterations)

    monkeypatch.setattr(estimates, "estimate", estimate)
    runs = [
        replace(run, seconds=None)
        for name in ("reacher", "single-car")
        for run in plan_experiment(ALL[name], "smoke", tmp_path).runs()
        if run.card.name in ("reacher", "racer-outer")
    ]
    assert seconds_left(runs) == pytest.approx(len(runs) * (2 * 2 * 3.0 + estimates.RUN_SECONDS))
    assert measured == [("reacher", "scratch", [0]), ("racer-outer", "scratch", [0])]


def test_an_experiment_is_the_same_when_its_iterations_are_timed_anew(tmp_path):
    one = ALL["reacher"]
    record = record_of(plan_experiment(one, "night", tmp_path), finished=True)
    night = one.scales["night"]
    timed = night.model_copy(update={"seconds": 99.0})
    assert record.is_of(one.model_copy(update={"scales": one.scales | {"night": timed}}))
    longer = night.model_copy(update={"iterations": night.iterations + 1})
    assert not record.is_of(one.model_copy(update={"scales": one.scales | {"night": longer}}))


def test_a_run_that_was_begun_goes_on_as_slowly_as_its_last_iteration(tmp_path, monkeypatch):
    run = plan_experiment(ALL["reacher"], "smoke", tmp_path).runs()[0]
    run = replace(run, card=run.card.with_settings(["ppo.n_iterations=5"]))
    clock = np.tile([3.0, 5.0, 12.0], (2, 1))
    begun = SimpleNamespace(
        returns=np.zeros((2, 3)), rows={"seconds": clock},
        record=SimpleNamespace(state="running", ranked=[SimpleNamespace(seconds=2.5)]),
    )  # fmt: skip
    monkeypatch.setattr(PlannedRun, "read", lambda _: begun)
    assert seconds_left([run]) == pytest.approx(2 * 7.0 + estimates.RUN_SECONDS)
    begun.returns, begun.rows = np.zeros((2, 1)), {"seconds": clock[:, :1]}
    assert seconds_left([run]) == pytest.approx(4 * 0.5 + estimates.RUN_SECONDS)


def test_the_command_of_an_experiment_names_its_file_and_its_place(home):
    shutil.copy(shipped("experiments") / "reacher.toml", home / "mine.toml")
    reacher = plan_experiment(read_experiment("reacher"), "smoke", INTO)
    assert reacher.command() == "repaint reproduce reacher --scale smoke"
    mine = plan_experiment(read_experiment("mine.toml"), "night", Path("a b"))
    wanted = "repaint reproduce mine.toml --scale paper --into 'a b' --jobs 2"
    assert mine.command("paper", EngineOptions(jobs=2)) == wanted


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('gathers = ["ratio"]', "'mine' gathers no panel at the scale night"),
        ('gathers = ["table-1"]', "'mine' gathers 'table-1', which gathers others; name those"),
    ],
)
def test_an_experiment_that_gathers_nothing_is_refused(home, text, said):
    (home / "mine.toml").write_text(f'summary = "Mine."\nitem = "none"\n{text}\n')
    with pytest.raises(CardError, match=said):
        plan_experiment(read_experiment("mine.toml"), "night", INTO)


def test_a_run_is_another_where_a_file_that_it_reads_is(home):
    shutil.copy(shipped("tasks") / "racer" / "tracks" / "oval.npy", home / "mine.npy")
    (home / "mine.toml").write_text('extends = "racer-inner"\nenv.track = "mine.npy"\n')
    card = read_task("mine.toml")
    run = PlannedRun(card, "scratch", (0,), (), home, None)
    before = run.key
    np.save(home / "mine.npy", 1.01 * np.load(home / "mine.npy"))
    assert run.key != before


def test_curves_keep_whole_numbers_whole(tmp_path):
    assert [results._cell(x) for x in (1_234_567.0, -7.25, 1 / 3, np.nan)] == [
        "1234567", "-7.25", "0.333333333", "",
    ]  # fmt: skip


def test_numbers_over_all_panels_leave_out_those_where_scratch_did_not_learn(tmp_path):
    panels = [a_panel(tmp_path / str(i), scratch=9.0, repaint=3.0) for i in range(2)]
    (over,) = over_panels(panels).items()
    assert over[0] == "repaint"
    assert over[1].improvement[0] == 1  # each of its seeds is ahead
    lines = list(over_markdown(dict([over])))
    assert lines[2].startswith("| repaint | 2 | ")
    falling = a_panel(tmp_path / "falling", scratch=9.0, repaint=3.0)
    run = falling.runs["scratch"]
    rows = dict(run.rows, eval_return=-run.returns)
    falling.runs["scratch"] = replace(run, rows=rows)
    assert over_panels([panels[0], falling]) == {}
    assert list(over_markdown({})) == []
