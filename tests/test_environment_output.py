"""What environments print, and warnings: in the run's log, or shown once; never between numbers."""

import sys
import threading
import warnings

import odd_envs
import pytest

from repaint_cli.envs.gymnasium.notices import in_our_words
from repaint_cli.envs.output import LARGEST_LOG, Output, captured, output_to, prints_in_file

pytestmark = pytest.mark.filterwarnings("default")  # as where users are
TRAIN = ("transfer", "--task", "odd.toml", "--method", "scratch")


class Heard(Output):
    def __init__(self):
        super().__init__()
        self.text, self.warned = "", []

    def prints(self, text):
        self.text += text

    def warns(self, text):
        self.warned.append(text)


@pytest.fixture
def chatty(home):
    (home / "odd.toml").write_text(odd_envs.card("Chatty", "near"))
    return home


def test_prints_of_an_environment_go_to_the_runs_log(repaint, chatty):
    said = repaint(*TRAIN, "--run", "run")
    assert said.code == 0
    log = (chatty / "run" / "environment.log").read_text()
    assert log.startswith("a simulator of 1998\n")
    assert log.count("step 1\nto stderr\n") > 6  # tried out, four in training, two evaluated
    assert "environment.log" in said.out
    assert "step 1" not in said.out + said.err


def test_the_log_is_appended_to_where_a_run_goes_on(repaint, chatty):
    repaint(*TRAIN, "--run", "run")
    before = (chatty / "run" / "environment.log").read_text()
    repaint("transfer", "--resume", "run", "--iterations", "2")
    after = (chatty / "run" / "environment.log").read_text()
    assert after.startswith(before)
    assert after.count("step 1\n") == 2 * before.count("step 1\n")


def test_a_warning_is_a_line_once(repaint, chatty):
    said = repaint(*TRAIN, "--run", "run")
    (line,) = said.err.splitlines()
    assert line.startswith("warning: odd_envs.py:")
    assert line.endswith("warns: the belt is loose (UserWarning)")


def test_without_a_run_each_line_is_shown_once(repaint, chatty):
    repaint(*TRAIN, "--run", "run")
    with output_to(Output()):
        said = repaint("eval", "run")
    assert said.code == 0
    assert "step" not in said.out
    lines = said.err.splitlines()
    assert lines.count("the environment prints: a simulator of 1998") == 1
    assert lines.count("the environment prints: step 1") == 1
    assert lines[-1].endswith("more of this kind, which is not shown")
    assert len(lines) == 11


def test_a_run_that_prints_nothing_has_no_log(repaint, home):
    (home / "odd.toml").write_text(odd_envs.card("Odd", "near"))
    repaint(*TRAIN, "--run", "run")
    assert not (home / "run" / "environment.log").exists()


def test_prints_before_a_run_has_a_folder_are_shown(repaint, chatty):
    said = repaint(*TRAIN, "--run", "odd.toml/run")
    assert said.code == 7
    assert "the environment prints: a simulator of 1998" in said.err
    assert said.err.splitlines()[-1].startswith("error: ")


def test_a_log_has_an_end(tmp_path):
    with prints_in_file() as prints:
        prints.path = tmp_path / "environment.log"
        for _ in range(30):
            prints.prints("x" * (LARGEST_LOG // 20))
    assert prints.path.read_text().endswith("xx\n(and so on)\n")
    assert prints.path.stat().st_size < 1.1 * LARGEST_LOG


def test_only_the_environments_thread_is_captured(capsys):
    heard = Heard()
    with output_to(heard), captured():
        print("mine")  # noqa: T201
        other = threading.Thread(target=lambda: print("another's"))  # noqa: T201
        other.start()
        other.join()
        sys.stdout.writelines(["a\n", "b\n"])
    print("afterwards")  # noqa: T201
    assert heard.text == "mine\na\nb\n"
    assert capsys.readouterr().out == "another's\nafterwards\n"


def test_an_error_leaves_the_streams_as_they_were():
    before = sys.stdout, sys.stderr, warnings.showwarning
    with pytest.raises(ValueError, match="the arm"), captured(), captured():
        raise ValueError("the arm fell off")
    assert before == (sys.stdout, sys.stderr, warnings.showwarning)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            "WARN: The environment Hopper-v3 is out of date. You should consider upgrading to "
            "version `v5`.",
            "the environment: Hopper-v3 is out of date; Gymnasium has v5 of it",
        ),
        (
            "WARN: The obs returned by the `step()` method is not within the observation space.",
            "the environment: step() returns observations that are not in their space",
        ),
        ("WARN: Something\n else.", "Gymnasium says of the environment: Something else."),
        ("overflow encountered in square", None),
    ],
)
def test_gymnasiums_warnings_in_our_words(text, line):
    assert in_our_words(text) == line
