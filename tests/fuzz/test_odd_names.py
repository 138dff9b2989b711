"""Texts out of files do nothing to a terminal: no escape sequence, no markup, no crash."""

import json

import pytest
from small_runs import add_teacher
from test_damaged_data import rows, run_of
from test_damaged_files import HEAD, record
from test_damaged_teachers import with_card

from repaint_cli.cli.console import literal, plain

TEXT = "\x1b]0;owned\x07\x1b[2J\r\b\x9b31m\u202e\x7f[red]x[/] [/bold] :boom: \\"


def test_a_text_is_spelled_out():
    assert plain("ä [red] x\n") == "ä [red] x\n"
    assert plain("\x1b[2J\x07\x9b\u202e") == r"\x1b[2J\x07\x9b\u202e"
    assert literal("[red]") == r"\[red]"


def harmless(said):
    shown = said.out + said.err
    assert all(c.isprintable() or c == "\n" for c in shown), shown
    return shown


@pytest.fixture
def damaged_teacher(home):
    """A teacher that says the text wherever a card may have one."""

    def speak(card):
        card["task"].update(summary=TEXT, reward={TEXT: 1.0})
        card["task"]["env"].update(id=TEXT, kwargs={TEXT: TEXT})
        card.update(method=TEXT, algorithm=TEXT, versions={TEXT: TEXT}, created=TEXT)

    path = add_teacher(home / "home" / "zoo", "talker")
    with_card(path, speak)
    return path


COMMANDS = [
    ("zoo list", "talker"),
    ("zoo show talker", "talker"),
    ("zoo verify", "is never run from a teacher's file"),
    ("eval talker", "owned"),
    ("eval talker --task reacher", r"knows the reward terms \x1b]0;owned"),
    ("similarity talker reacher", "not comparable"),
    ("similarity talker reacher reacher-gentle", "talker|reacher"),
    ("transfer --teacher talker --task reacher", r"knows the reward terms \x1b]0;owned"),
    ("zoo list --fits reacher", "teacher"),
]


@pytest.mark.parametrize(("words", "message"), COMMANDS, ids=lambda x: "")
def test_a_teachers_texts_do_nothing_to_a_terminal(repaint, damaged_teacher, words, message):
    shown = harmless(repaint(*words.split()))
    assert any(part in shown for part in message.split("|")), shown


def test_files_of_any_name_do_nothing_to_a_terminal(repaint, damaged_teacher):
    name = "\x1b[2J[red]x[bold]"
    sound = add_teacher(damaged_teacher.parent, "sound")
    sound.rename(sound.with_stem(name))
    (damaged_teacher.parent / "[bold]\x07.safetensors").write_bytes(b"x")
    for words in ("list", "verify"):  # a file of no teacher's name is no teacher
        assert "x[bold]" not in harmless(repaint("zoo", words))
    assert r"unknown teacher 'x\x1b[2J'" in harmless(repaint("zoo", "show", "x\x1b[2J"))
    assert r"No such option: --x\x1b[2J" in harmless(repaint("zoo", "list", "--x\x1b[2J"))


def test_a_cards_texts_do_nothing_to_a_terminal(repaint, home):
    text = json.dumps(TEXT)
    (home / "mine.toml").write_text(
        f"summary = {text}\n[env]\nsimulator = 'gymnasium'\nid = {text}\n[reward]\n{text} = 1\n"
        f"[env.kwargs]\n{text} = {text}\n".replace("\\b", "\\u0008").replace("\x7f", "\\u007f")
    )
    shown = harmless(repaint("tasks", "show", "mine.toml"))
    assert shown.count("[red]x[/]") == 5
    assert "owned" in harmless(repaint("tasks", "check", "mine.toml"))
    (home / "mine.toml").write_text(f"summary = 'x'\n{text} = 1".replace("\x7f", "\\u007f"))
    said = repaint("tasks", "show", "mine.toml")
    assert said.code == 3
    harmless(said)


def test_a_runs_texts_do_nothing_to_a_terminal(repaint, home):
    for name in ("[red]a", "[bold]b"):
        (home / name).mkdir()
        run_of(home / name, record(state=TEXT), HEAD + rows((1, 0), (2, 0)))
    shown = harmless(repaint("compare", "[red]a", "[bold]b", "--output", "x.png"))
    assert "[red]a" in shown
    assert "run 2  scratch ([bold]b)" in shown
