"""run.json: it reads what it writes, and what earlier versions wrote."""

import json

import pytest
from small_runs import QUICK_LAP
from test_runs import SCRATCH

from repaint_cli.envs.racer.deepracer.training_metrics import TAIL
from repaint_cli.errors import CheckpointError
from repaint_cli.runs import record
from repaint_cli.runs.alarms import alarms_until
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.plan import Plan, difference
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.record import RunRecord
from repaint_cli.runs.record_parts import Alarm, TeacherRecord
from repaint_cli.runs.teachers import RunTeachers
from repaint_cli.tasks.card_files import read_task

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

CARD = read_task("reacher").model_dump(mode="json")
TEACHER = {"name": "old-hand", "sha256": "ab" * 32}
FIRST = {
    "schema_version": 1, "state": "finished", "method": "repaint", "teacher": TEACHER,
    "seeds": [0, 1], "task": CARD, "transfer": {}, "versions": {"torch": "2.6"}, "iterations": 3,
}  # fmt: skip
SECOND = {
    "schema_version": 2, "state": "finished", "algorithm": "q-learning", "method": "instance",
    "teachers": [TEACHER | {"instances": True}], "automatic": True, "seeds": [4], "task": CARD,
    "transfer": {}, "versions": {"torch": "2.6"}, "iterations": 3,
    "alarms": [{"iteration": 2, "kind": "nothing-kept", "text": "iteration 2: no teacher"}],
    "seconds": 12,
}  # fmt: skip
NO_TEACHERS = RunTeachers(read_task("racer-inner"), (), (), (), ())
TABLE = "iteration,seed,eval_return,eval_progress,env_steps,kickstart_coef,kept_fraction,seconds\n"


def alarm(k, kind="nothing-kept"):
    return Alarm(iteration=k, kind=kind, text=f"iteration {k}: ζ")


def begun(folder, **changes):
    """A record on disk, and where it is."""
    files = RunFolder(folder)
    begun = RunRecord(method="scratch", seeds=[0], task=CARD, teachers=[], **changes)
    begun.write(files)
    return begun, files


def test_a_record_reads_what_it_writes(tmp_path):
    teacher = TeacherRecord(name="a", sha256="0", instances=False, file="/somewhere/ζ")
    written, files = begun(
        tmp_path, state="running", teacher_name="mine", keep=3, versions={"torch": "2"}, threads=2,
        alarms=[alarm(1)], seconds=0.5, iterations=7,
    )  # fmt: skip
    assert RunRecord.read(files) == written
    written.teachers.append(teacher)
    written.go_on_with({"torch": "3"})
    written.write(files)
    again = RunRecord.read(files)
    assert again == written
    assert again.resumed[0].after == 7
    assert again.model_fields_set == set(RunRecord.model_fields)


def test_a_run_s_record_is_read_and_written_to_the_byte(repaint, lay, home):
    lay(*SCRATCH)
    text = (home / "run" / "run.json").read_bytes()
    RunRecord.read(RunFolder(home / "run")).write(RunFolder(home / "run"))
    assert (home / "run" / "run.json").read_bytes() == text


@pytest.mark.parametrize(
    ("earlier", "label", "absent"),
    [
        (FIRST, "repaint from old-hand", "algorithm"),
        (FIRST | {"teacher": None, "method": "scratch"}, "scratch", "algorithm"),
        (SECOND, "q-learning instance auto from old-hand", "teacher_name"),
    ],
)
def test_what_earlier_versions_wrote_is_read_and_not_resumed(tmp_path, earlier, label, absent):
    (tmp_path / "run.json").write_text(json.dumps(earlier))
    (tmp_path / "metrics.csv").write_text(TABLE)
    run = read_run(tmp_path)
    assert (run.label, run.seeds) == (label, earlier["seeds"])
    message = f"of an earlier version or damaged, and cannot be resumed: {absent}: Field required"
    with pytest.raises(CheckpointError, match=message):
        read_run(tmp_path, to_resume=True)


def test_alarms_are_beside_the_record_until_it_takes_them_in(tmp_path):
    written, files = begun(tmp_path)
    written.add_alarms([], files)
    assert not files.new_alarms.exists()
    written.add_alarms([alarm(1), alarm(1, "teacher-behind")], files)
    written.add_alarms([alarm(2)], files)
    on_disk = RunRecord.read(files)
    assert on_disk.alarms == []
    assert alarms_until(2, files, on_disk) == written.alarms
    assert alarms_until(1, files, on_disk) == written.alarms[:2]
    with files.new_alarms.open("a") as file:
        file.write('{"iteration": 3, "ki')  # killed
    assert alarms_until(3, files, on_disk) == written.alarms
    journal = files.new_alarms.read_bytes()
    written.write(files)
    assert not files.new_alarms.exists()
    files.new_alarms.write_bytes(journal)  # killed before it was removed
    assert alarms_until(3, files, RunRecord.read(files)) == written.alarms


def test_alarms_that_are_damaged_are_said(tmp_path):
    written, files = begun(tmp_path)
    files.new_alarms.write_text("{}\n")
    with pytest.raises(CheckpointError, match=r"new-alarms.jsonl is damaged: .*iteration"):
        alarms_until(1, files, written)


def test_no_more_alarms_are_written_than_recorded(tmp_path, monkeypatch):
    monkeypatch.setattr(record, "MOST_ALARMS", 3)
    written, files = begun(tmp_path)
    for k in range(1, 9):
        written.add_alarms([alarm(k), alarm(k, "teacher-behind")], files)
    assert len(written.alarms) == 3
    assert alarms_until(9, files, RunRecord.read(files)) == written.alarms


def test_a_row_that_is_half_written_is_no_row(repaint, lay, home):
    lay(*SCRATCH)
    path = home / "run" / "metrics.csv"
    text = path.read_text()
    for end in ("3,0,pp", "3,0", "3", "\0\0\0"):
        path.write_text(text + end)
        assert read_run(home / "run").returns.shape == (1, 2)
        assert repaint("compare", "run").code == 0
        assert repaint("transfer", "--resume", "run").code == 0
        assert path.read_text() == text


def test_files_that_grow_are_appended_to_and_no_others_grow(repaint, home):
    words = ["transfer", "--method", "scratch", "--task", "racer-inner", "--run", "run"]
    repaint(*words, *QUICK_LAP)
    metrics = home / "run" / "deepracer" / "seed-0" / "metrics" / "TrainingMetrics.json"
    growing = [home / "run" / "metrics.csv", metrics]
    before = [(path.stat().st_ino, path.read_bytes()) for path in growing]
    size = (home / "run" / "checkpoint.safetensors").stat().st_size
    repaint("transfer", "--resume", "run", "--iterations", 4)
    for path, (inode, data) in zip(growing, before, strict=True):
        assert path.stat().st_ino == inode  # another file would have another
        assert path.read_bytes().startswith(data.removesuffix(TAIL.encode()))
        assert path.stat().st_size > len(data)
    assert abs((home / "run" / "checkpoint.safetensors").stat().st_size - size) < 64  # digits
    assert len(json.loads(metrics.read_text())["metrics"]) == 4 * (3 + 2)


ODD = [
    ({"seconds": None}, "run.json is of an earlier version or damaged.*: seconds: "),
    ({"alarms": [{"iteration": "x"}]}, "damaged, and cannot be resumed: alarms.0.iteration: "),
    ({"keep": 0}, "damaged, and cannot be resumed: keep: "),
    ({"schema_version": "3"}, "damaged, and cannot be resumed: schema_version: "),
    ({"state": 3, "transfer": None, "replace": "no", "iterations": -1}, "cannot be resumed: state"),
    ({"versions": None}, "^run.json does not say with what it began: versions: "),
    ({"teachers": [TEACHER | {"instances": None}]}, "cannot be resumed: teachers.0.instances: "),
]


@pytest.mark.parametrize(("changes", "message"), ODD)
def test_what_only_a_resumed_run_needs_may_be_odd_where_runs_are_compared(
    tmp_path, changes, message
):
    _, files = begun(tmp_path, keep=2)
    data = json.loads(files.record.read_text()) | changes
    files.record.write_text(json.dumps(data))
    files.metrics.write_text(TABLE)
    run = read_run(tmp_path)
    assert (run.method, run.seeds) == ("scratch", [0])
    with pytest.raises(CheckpointError, match=message):
        read_run(tmp_path, to_resume=True)


@pytest.mark.parametrize(
    "changes",
    [{"method": "magic"}, {"seeds": [0, 0]}, {"seeds": ["0"]}, {"teachers": [{}]}, {"task": 1},
     {"automatic": "yes"}, {"algorithm": None}],
)  # fmt: skip
def test_what_runs_are_compared_by_is_checked(tmp_path, changes):
    _, files = begun(tmp_path)
    files.record.write_text(json.dumps(json.loads(files.record.read_text()) | changes))
    for to_resume in (False, True):
        with pytest.raises(CheckpointError, match=r"run\.json is damaged: "):
            read_run(tmp_path, to_resume=to_resume)


@pytest.mark.parametrize("name", ["versions", "resumed"])
def test_a_run_that_does_not_say_with_what_it_began_is_not_resumed(tmp_path, name):
    _, files = begun(tmp_path)
    data = json.loads(files.record.read_text())
    del data[name]
    files.record.write_text(json.dumps(data))
    message = f"^run.json does not say with what it began: '{name}'$"
    with pytest.raises(CheckpointError, match=message):
        RunRecord.read_resumable(files)


def test_every_file_of_the_user_s_identifies_a_run(tmp_path, monkeypatch):
    plan = Plan(read_task("racer-inner"), "scratch", [0], tmp_path)
    names = {"track": tmp_path / "a.npy", "map": tmp_path / "b.npy"}
    for path in names.values():
        path.write_text(path.name)
    assert "track" not in plan.identity(NO_TEACHERS)
    monkeypatch.setattr(type(plan.task.env), "files", lambda _: names)
    before = plan.identity(NO_TEACHERS)
    names["map"].write_text("other")
    after = plan.identity(NO_TEACHERS)
    assert difference(before, after).startswith("map ")
    assert before["track"] == after["track"]
