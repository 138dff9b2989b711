"""The pages in docs/: how they begin, that what they name is there, and that all is documented."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer

from repaint_cli import errors
from repaint_cli.cli.app import app
from repaint_cli.envs.registry import simulator_classes
from repaint_cli.runs.folder import RunFolder
from repaint_cli.tasks.card import TaskCard

ROOT = Path(__file__).parents[1]
PAGES = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}
TEXTS = PAGES | {
    name: (ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "CONTRIBUTING.md")
}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[[^\]\[]*\]\(([^)\s]+)\)")
NOTEBOOK = "transfer.ipynb"
TO_LOOK_UP = {"index.md", "results.md", "speed.md"}
"""Pages that need not begin with what a command prints."""


def prose(text):
    return FENCE.sub("", text)


def inline_code(text):
    """Every piece of inline code, a line break in it being a space."""
    return [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", prose(text))]


def anchors(text):
    """The anchors of a page's headings, as GitHub and as MkDocs name them."""
    headings = re.findall(r"^#{1,6} (.*)$", prose(text), re.MULTILINE)
    return [
        re.sub(r"[\s]+", "-", re.sub(r"[^\w\s-]", "", title).strip().lower()) for title in headings
    ]


def path_of(name):
    return ROOT / name if name in ("README.md", "CONTRIBUTING.md") else ROOT / "docs" / name


@pytest.mark.parametrize("name", sorted(PAGES.keys() - TO_LOOK_UP))
def test_a_page_begins_with_a_command_what_it_prints_and_how_long_it_takes(name):
    beginning = PAGES[name].partition("\n## ")[0]
    blocks = [kind for kind, _ in FENCE.findall(beginning)]
    assert blocks.index("") < blocks.index("text")  # commands have no language, what they print has
    assert re.search(r"\b(seconds?|minutes?|\d+ s)\b", prose(beginning))


@pytest.mark.parametrize("symbol", ["β", "ζ"])
def test_a_page_says_what_a_symbol_means_or_where_that_is_said(symbol):
    users = {name for name, text in PAGES.items() if symbol in prose(text)}
    assert {"transfer.md", "paper.md", "results.md"} <= users
    for name in users:
        assert f"**{symbol}**" in PAGES[name] or "](transfer.md)" in PAGES[name], name


@pytest.mark.parametrize("name", [*sorted(TEXTS), NOTEBOOK])
def test_every_link_resolves(name):
    notebook = (ROOT / "docs" / NOTEBOOK).read_text(encoding="utf-8")
    for target in LINK.findall(prose(TEXTS.get(name, notebook))):
        if target.startswith("https://"):
            continue
        file, _, anchor = target.partition("#")
        path = (path_of(name).parent / file).resolve() if file else path_of(name)
        assert path.is_file(), target
        if name in PAGES:
            assert path.is_relative_to(ROOT / "docs"), f"{target} is not in the site"
        if anchor:
            assert anchor in anchors(path.read_text(encoding="utf-8")), target


def test_no_heading_of_a_page_is_there_twice():
    for name, text in PAGES.items():
        assert len(anchors(text)) == len(set(anchors(text))), name


def options():
    """Every option of every command."""
    waiting = [typer.main.get_command(app)]
    while waiting:
        command = waiting.pop()
        waiting += getattr(command, "commands", {}).values()
        for parameter in command.params:
            yield from (*parameter.opts, *parameter.secondary_opts)


@pytest.mark.parametrize("name", sorted(PAGES.keys() | {"README.md"}))
def test_every_option_that_is_named_exists(name):
    known = {*options(), "--help"}
    for code in inline_code(TEXTS[name]):
        if not code.startswith(("python ", "pip ")):
            for option in re.findall(r"(?:^|\s)(--[a-z][a-z-]*)", code):
                assert option in known, code


def test_every_setting_that_is_named_exists():
    sections = {
        name: set(getattr(field.annotation, "model_fields", ()))
        for name, field in TaskCard.model_fields.items()
    }
    sections["env"] = {key for kind in simulator_classes() for key in kind.model_fields}
    sections["reward"] = set()
    named = set()
    for name in PAGES.keys() | {"README.md"}:
        for code in inline_code(TEXTS[name]):
            named |= set(re.findall(rf"\b({'|'.join(sections)})\.([a-z_0-9]+)", code))
    assert len(named) > 40
    unknown = {f"{section}.{key}" for section, key in named if key not in sections[section]}
    files = {"ppo.py", "transfer.py", "eval.json"}
    own = {"env.model_metadata", "ppo.hyperparameters", "reward.function", "reward.scale"}
    assert unknown - files == own


@pytest.mark.parametrize("name", sorted(TEXTS))
def test_every_file_of_the_repository_that_is_named_exists(name):
    for code in inline_code(TEXTS[name]):
        for path in re.findall(
            r"(?<![\w/])(?:tests|benchmarks|tools|repaint_cli|docs)/[\w/.-]+", code
        ):
            assert (ROOT / path.rstrip(".")).exists(), path


def test_every_exit_code_is_documented():
    table = PAGES["trouble.md"].partition("\n## Exit codes\n")[2]
    codes = {kind.exit_code for kind in vars(errors).values() if hasattr(kind, "exit_code")}
    codes |= {0, errors.MISTAKE, 130, 143}
    assert codes == {int(n) for n in re.findall(r"^\| (\d+) \|", table, re.MULTILINE)}


def test_every_alarm_is_documented_with_what_to_do():
    source = (ROOT / "repaint_cli" / "runs" / "alarms.py").read_text(encoding="utf-8")
    kinds = set(re.findall(r'"([a-z]+(?:-[a-z]+)+)"', source))
    assert len(kinds) > 5
    table = re.findall(r"^\| `([a-z-]+)` \| .+ \| .+ \|$", PAGES["trouble.md"], re.MULTILINE)
    assert kinds == set(table)


def test_every_file_of_a_run_is_documented():
    table = PAGES["reference.md"].partition("\n## Files of a run\n")[2].partition("\n## ")[0]
    files = {
        getattr(RunFolder(Path("run")), name).name
        for name, member in vars(RunFolder).items()
        if isinstance(member, property)
    }
    assert len(files) > 10
    for file in files:
        assert f"`{file}" in table, file


def test_the_help_on_the_page_is_what_the_command_prints():
    (page,) = re.findall(
        r"^```\nrepaint transfer --help\n```\n\n```text\n(.*?)^```$", PAGES["reference.md"],
        re.DOTALL | re.MULTILINE,
    )  # fmt: skip
    env = os.environ | {"COLUMNS": "80"}
    words = [sys.executable, "-m", "repaint_cli", "transfer", "--help"]
    said = subprocess.run(words, capture_output=True, text=True, env=env, check=True).stdout
    assert page.strip() == said.replace("python -m repaint_cli", "repaint").strip()


def test_every_section_of_a_card_is_documented():
    table = PAGES["reference.md"].partition("\n## Settings\n")[2].partition("\n## ")[0]
    settings = TaskCard.model_fields.keys() - {"name", "summary", "reward_code"}
    assert settings == set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE))


@pytest.mark.parametrize("name", sorted(PAGES.keys() | {"README.md"}))
def test_code_in_other_languages_can_be_read(name):
    for kind, block in FENCE.findall(TEXTS[name]):
        assert kind in ("", "text", "python", "toml"), kind
        if kind == "python":
            compile(block, name, "exec")
        if kind == "toml":
            assert tomllib.loads(block)["summary"]


def test_what_is_to_be_installed_can_be():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    names = {re.split(r"[\[=<>]", wanted)[0] for wanted in PROJECT["dependencies"]}
    for extra in PROJECT["optional-dependencies"].values():
        names |= {re.split(r"[\[=<>]", wanted)[0] for wanted in extra}
    for text in PAGES.keys() | {"README.md"}:
        calls = [line for _, block in FENCE.findall(TEXTS[text]) for line in block.splitlines()]
        for call in [*inline_code(TEXTS[text]), *calls]:
            if call.startswith("make "):
                assert re.search(rf"^{call.split()[1]}:", makefile, re.MULTILINE), call
            if call.startswith("pip install --"):
                (extra,) = re.findall(rf"{PROJECT['name']}\[(\w+)\] @ git\+ADDRESS", call)
                assert extra in PROJECT["optional-dependencies"]
            elif call.startswith("pip install "):
                wanted = shlex.split(call)[2:]
                assert {re.split(r"[\[=<>]", one)[0] for one in wanted} <= names, call


def test_no_message_tells_to_install_what_is_not_published():
    for path in (ROOT / "repaint_cli").rglob("*.py"):
        for advice in re.findall(r"pip install[^\"\n]*", path.read_text(encoding="utf-8")):
            assert PROJECT["name"] not in advice, path


def test_the_site_is_built_without_a_warning_and_asks_no_network(tmp_path):
    pytest.importorskip("mkdocs", reason="needs mkdocs, of the extra docs")
    words = ["-m", "mkdocs", "build", "--site-dir", str(tmp_path / "site")]
    said = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    pages = {path.stem for path in (tmp_path / "site").glob("*.html")}
    assert pages >= {name.removesuffix(".md") for name in PAGES}
    for path in (tmp_path / "site").rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.findall(
            r"<(?:script|img|link)[^>]*(?:src|href)=[\"']?(?:https?:)?//", text
        ), path
