"""README and pages are a test: every command is shown and explained, and can be typed."""

import csv
import io
import re
import shlex
from itertools import pairwise
from pathlib import Path

import methods
import pytest
import typer

from repaint_cli.cli.app import app
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.tasks.card_files import read_task

ROOT = Path(__file__).parents[1]
RESULTS = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
MANUALS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PLACEHOLDER = re.compile(r"[…\[|]|\bCOMMAND\b")


def commands(group, words=("repaint",)):
    """Every command by the words that call it."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*words, name))
        else:
            yield " ".join((*words, name)), command


COMMANDS = dict(commands(typer.main.get_command(app)))


def shown(path):
    """Every `repaint …` line of a page's code blocks, what is printed as next, and inline code."""
    text = path.read_text(encoding="utf-8")
    lines = list[str]()
    for kind, block in re.findall(r"^```(\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        mark = "next: " if kind == "text" else ""  # of a command in what another printed
        found = [line for line in block.splitlines() if line.startswith(mark)]
        lines += [line.removeprefix(mark) for line in found]
    inline = re.findall(r"`(repaint [^`]*)`", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M))
    calls = [line.strip() for line in lines] + [" ".join(i.split()) for i in inline]
    return [call for call in calls if call.startswith("repaint ") and not PLACEHOLDER.search(call)]


SHOWN = sorted({call for path in MANUALS for call in shown(path)})


@pytest.mark.parametrize("command", COMMANDS)
def test_the_readme_shows_it_and_help_explains_it(command):
    assert any(f"{call} ".startswith(f"{command} ") for call in shown(ROOT / "README.md"))
    assert (COMMANDS[command].help or "").strip().endswith(".")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_explained_in_a_sentence(command):
    for parameter in COMMANDS[command].params:
        assert (parameter.help or "").endswith((".", "…")), f"{command} {parameter.name}"


def type_in(call):
    """Parse a call as far as it can be without running it."""
    words = shlex.split(call, comments=True)
    if words[1] == "reproduce" and words[2] not in ("run", "list", "copy", "--help"):
        words.insert(2, "run")  # which may be left out
    command = next((c for n in (4, 3, 2) if (c := COMMANDS.get(" ".join(words[:n])))), None)
    if command is None:
        assert words[1:] in (["--help"], ["--version"]), f"there is no command {call}"
    else:
        rest = words[len(next(name for name in COMMANDS if COMMANDS[name] is command).split()) :]
        command.make_context(call, rest, resilient_parsing="--help" in rest)


@pytest.mark.parametrize("call", SHOWN)
def test_what_is_shown_can_be_typed(call):
    type_in(call)


@pytest.mark.parametrize("call", [call for call in SHOWN if " --set " in call])
def test_settings_that_are_shown_can_be_set(call):
    words = shlex.split(call)
    given = dict(pairwise(words))
    task = read_task(given["--task"] if given.get("--task") in shipped_tasks() else "racer-inner")
    for word, setting in pairwise(words):
        if word == "--set" and not setting.startswith("section."):
            task.with_settings([setting])


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_has_a_heading_and_a_metavar(command):
    for parameter in COMMANDS[command].params:
        assert parameter.rich_help_panel, parameter.name
        assert getattr(parameter, "is_flag", False) or re.fullmatch(
            r"[^<>]+", parameter.metavar or ""
        ), parameter.name


@pytest.mark.parametrize("command", COMMANDS)
def test_help_ends_in_two_examples_that_can_be_typed(command):
    examples = [line.strip() for line in COMMANDS[command].epilog.splitlines()]
    assert len(set(examples)) == 2
    for example in examples:
        assert f"{example} ".startswith(f"{command} ")
        assert len(example) <= 78
        type_in(example.partition(" | ")[0])


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_a_page_that_a_terminal_can_show(monkeypatch, command, encoding):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO(), encoding=encoding))
    page_of = dict(commands(typer.main.get_command(app)))[command]
    page = page_of.get_help(typer.Context(page_of, info_name=command))
    page.encode(encoding)
    assert max(map(len, page.splitlines())) <= 80
    headings = re.findall(r"^(\S.*):$", page, re.MULTILINE)
    assert headings[-1] == "Examples"
    assert len(set(headings)) == len(headings) > 1
    assert "<" not in page


@pytest.mark.parametrize("task", sorted(methods.TEACHERS))
def test_the_tables_are_those_that_were_measured(task):
    with (methods.RESULTS / f"readme-{task}.csv").open(encoding="utf-8", newline="") as file:
        measured = list(csv.DictReader(file))
    for line in methods.markdown(measured):
        assert line in RESULTS
