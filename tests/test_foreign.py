"""Places that users name: their files stay, ours are replaced; and commands that can be typed."""

import json
import subprocess

import pytest
from small_runs import QUICK, QUICK_LAP, add_teacher
from test_runs import SCRATCH

from repaint_cli.errors import CheckpointError, NotFound, StoreError, TeacherMismatch, UsageError
from repaint_cli.files.commands import command
from repaint_cli.files.paths import shipped
from repaint_cli.policies.spaces import Spaces
from repaint_cli.runs.folder import RunFolder

ODD = [
    "-dash",
    "a space",
    "it's",
    'a "quote"',
    "$HOME",
    "ä ö",
    "two\nlines",
    "\x1b[31m",
    "a\\b",
    "*",
]


def words_of(line):
    """The words that a shell reads in a line."""
    script = f"printf '%s\\0' {line}"
    said = subprocess.run(["bash", "-c", script], capture_output=True, check=True, text=True)
    return said.stdout.split("\0")[:-1]


@pytest.mark.parametrize("name", ODD)
def test_a_command_is_one_line_that_a_shell_reads_as_the_same_words(name):
    line = command("repaint eval {} --render-offscreen", name)
    assert line.isprintable()
    wanted = f"./{name}" if name.startswith("-") else name
    assert words_of(line) == ["repaint", "eval", wanted, "--render-offscreen"]


@pytest.mark.parametrize("name", ["-dash", "two\nlines and 'more'"])
def test_what_is_printed_as_next_can_be_typed(repaint, home, name):
    said = repaint(*SCRATCH[: -len(QUICK) - 1], f"./{name}", *QUICK)
    for verb in ("eval", "open"):
        (line,) = (line for line in said.out.splitlines() if line.startswith("next: repaint "))
        words = words_of(line.removeprefix("next: repaint ").removesuffix(" --render-offscreen"))
        assert words[0] == verb
        said = repaint(*words)
        assert said.code == 0
    said = repaint("compare", f"./{name}", "--report", name)
    words = words_of(said.out.splitlines()[-1].removeprefix("next: repaint "))
    assert (words[0], repaint(*words).code) == ("open", 0)


def test_an_export_leaves_a_page_of_the_user_alone(repaint, home):
    page = home / "README.md"
    page.write_text("my own page")
    said = repaint("zoo", "export", "reacher", ".")
    assert (said.code, said.err.count("\n")) == (StoreError.exit_code, 1)
    assert "README.md is there and was not written by repaint; name another folder" in said.err
    assert [path.name for path in home.iterdir() if path.is_file()] == ["README.md"]
    assert page.read_text() == "my own page"
    assert repaint("zoo", "export", "reacher", ".", "--replace").code == 0
    assert page.read_text().startswith("# reacher")
    assert repaint("zoo", "export", "reacher-gentle", ".").code == 0
    assert page.read_text().startswith("# reacher-gentle")


def test_a_comparison_leaves_files_of_the_user_alone(repaint, lay, home):
    lay(*SCRATCH)
    (home / "report").mkdir()
    for place in ("notes.md", "compare.png", "report/curves.csv"):
        (home / place).write_text("mine")
    compare = ["compare", "run"]
    for words, place in [
        (["--output", "notes.md"], "notes.md"), ([], "compare.png"),
        (["--report", "report"], "report/curves.csv"),
        (["--trajectories", "--output", "compare.png"], "compare.png"),
    ]:  # fmt: skip
        said = repaint(*compare, *words)
        assert said.code == StoreError.exit_code
        assert said.err.startswith(f"error: {place} is there and was not written by repaint")
        assert (home / place).read_text() == "mine"
    for words in ([], ["--report", "report"]):
        assert repaint(*compare, *words, "--replace").code == 0
        assert repaint(*compare, *words).code == 0


def test_a_comparison_is_refused_before_it_trains(repaint, home):
    (home / "compare.png").write_text("mine")
    said = repaint("compare", "--task", "reacher", "--methods", "scratch")
    assert said.code == StoreError.exit_code
    assert not (home / "runs").exists()


def test_a_drawing_of_a_track_and_a_log_leave_files_of_the_user_alone(repaint, home):
    (home / "oval.png").write_text("mine")
    said = repaint("tasks", "check", shipped("tasks") / "racer" / "tracks" / "oval.npy")
    assert (said.code, (home / "oval.png").read_text()) == (StoreError.exit_code, "mine")
    repaint("transfer", "--method", "scratch", "--task", "racer-inner", "--run", "run", *QUICK_LAP)
    settings = home / "model" / "model_metadata.json"
    settings.parent.mkdir()
    settings.write_text("mine")
    said = repaint("eval", "run", "--simtrace", ".")
    assert said.code == StoreError.exit_code
    assert settings.read_text() == "mine"


def test_a_refusal_among_thousands_of_teachers_is_a_line(repaint, home):
    zoo = home / "home" / "zoo"
    add_teacher(zoo, "stranger", spaces=Spaces((4,), 3, True))
    first = add_teacher(zoo, "fits-0000")
    for n in range(1, 2000):
        (zoo / f"fits-{n:04}.safetensors").hardlink_to(first)
    for words, error in [
        (["--teacher", "stranger"], TeacherMismatch), (["--teacher", "unknown"], NotFound),
        (["--teacher", "fits-0001", "--instances-from", "fits-0002"], UsageError),
    ]:  # fmt: skip
        said = repaint("transfer", "--task", "reacher", *words)
        assert said.code == error.exit_code
        assert (said.err.count("\n"), len(said.err) < 700) == (1, True)


def test_a_record_of_too_many_seeds_is_refused(repaint, lay, home):
    lay(*SCRATCH)
    path = RunFolder(home / "run").record
    record = json.loads(path.read_text()) | {"seeds": list(range(60_000))}
    path.write_text(json.dumps(record))
    for words in (["eval", "run"], ["compare", "run"], ["transfer", "--resume", "run"]):
        said = repaint(*words)
        assert (said.code, said.err.count("\n")) == (CheckpointError.exit_code, 1)
        assert "at most 1000 items" in said.err
    said = repaint("transfer", "--task", "reacher", "--method", "scratch", "--seeds", 10**9)
    assert said.err == "error: expected --seeds of at most 1,000, found 1000000000\n"
