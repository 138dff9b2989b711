"""report.html, the page of a run and of a comparison: what it says, and what it must not do."""

import base64
import hashlib
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from small_runs import QUICK
from written_runs import climb, draw, write_run

import repaint_cli
from repaint_cli.cli import open as open_command
from repaint_cli.errors import CardError, NotFound, StoreError
from repaint_cli.runs import page_curves, page_files, page_tables, run_page
from repaint_cli.runs.comparison import comparison_of
from repaint_cli.runs.comparison_words import target_name
from repaint_cli.runs.glossary import GLOSSARY, MEANING_OF
from repaint_cli.runs.page_curves import MOST_POINTS, curves_json
from repaint_cli.runs.run_page import fresh_page, write_run_page
from repaint_cli.runs.settings_shown import chosen_settings, differing_settings

SCRATCH = ["transfer", "--task", "reacher", "--method", "scratch", *QUICK]


class Page(HTMLParser):
    """A page's tags with their attributes, its texts, and its tables as rows of texts."""

    def __init__(self, path):
        super().__init__()
        self.tags, self.tables, self.scripts, self.text = [], [], [], []
        self._inside = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self._inside.append(tag)
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
        elif tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag):
        while self._inside and self._inside.pop() != tag:
            pass

    def handle_data(self, data):
        if "script" in self._inside:
            self.scripts[-1] += data
        elif "td" in self._inside or "th" in self._inside:
            self.tables[-1][-1][-1] += data
        if not {"script", "style"} & set(self._inside):
            self.text.append(data)

    @property
    def words(self):
        return " ".join("".join(self.text).split())

    @property
    def data(self):
        return json.loads(self.scripts[0])

    def each(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture
def two(home):
    """A run from scratch and a quicker one with a teacher, never trained."""
    return {
        "scratch": write_run(home / "one", climb(speed=8)),
        "repaint from gentle": write_run(
            home / "two", climb(speed=2), "repaint", ["gentle"], ["ppo.gamma=0.9"], taught=6,
            alarms=[(2, "nothing-kept", "no teacher sample was kept")],
        ),
    }  # fmt: skip


def test_a_finished_run_has_a_page_and_says_so(repaint, home):
    said = repaint(*SCRATCH, "--run", "run")
    assert (said.code, said.err) == (0, "")
    assert "report.html" in said.out
    page = Page(home / "run" / "report.html")
    assert page.each("title") == [{}]
    assert "reacher: scratch" in page.words
    assert "2 of 2" in page.words
    assert len(page.each("img")) == 1  # the trajectories
    assert page.data["runs"][0]["across"]["iteration"] == [1, 2]


def test_a_page_needs_no_network_and_runs_nothing_but_its_own(two, home):
    draw(home / "two" / "trajectories.png")
    path = write_run_page(two["repaint from gentle"])
    page, text = Page(path), path.read_text(encoding="utf-8")
    names = [one["id"] for _, one in page.tags if "id" in one]
    assert len(names) == len(set(names))
    addresses = [one[key] for _, one in page.tags for key in ("src", "href") if one.get(key)]
    assert addresses
    assert all(address.startswith(("data:", "#", "curves.png")) for address in addresses)
    assert not [one for _, one in page.tags if any(name.startswith("on") for name in one)]
    (policy,) = [m["content"] for m in page.each("meta") if "Policy" in m.get("http-equiv", "")]
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    for name, own in (
        ("script", page.scripts[1]),
        ("style", re.search("<style>(.*)</style>", text, re.S)[1]),
    ):
        digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
        assert f"{name}-src 'sha256-{digest}'" in policy


HOSTILE = "</script><img src=x onerror=alert(1)><script>alert(2)"


def test_the_names_of_strangers_are_texts(repaint, home):
    """A path may end a script, a summary and an alarm too."""
    alarm = [(1, "<b>bold</b>", "<script>alert(3)</script> {{ 7 * 7 }}")]
    for name in ("a", "b"):
        write_run(home / name / HOSTILE, climb(), alarms=alarm, summary="<script>alert(4)</script>")
    folders = [f"{name}/{HOSTILE}" for name in ("a", "b")]
    said = repaint("compare", *folders, "--report", "<script>")
    assert said.code == 0, said.err
    for path in (home / "<script>" / "report.html", fresh_page(home / folders[0])):
        page = Page(path)
        assert len(page.scripts) == 2
        assert all(image["src"].startswith("data:image/png;") for image in page.each("img"))
        assert not page.each("b")
        assert "<script>alert(4)</script>" in page.words
        assert "<script>alert(3)</script> {{ 7 * 7 }}" in page.words
    page = Page(home / "<script>" / "report.html")
    assert [run["label"] for run in page.data["runs"]] == [f"scratch ({f})" for f in folders]
    assert page.tables[0][1][0] == f"scratch ({folders[0]})"


@pytest.mark.parametrize("fails", ["page", "disk"])
def test_a_page_that_fails_costs_a_line_and_no_run(repaint, home, monkeypatch, fails):
    def stop(*_):
        raise {"page": TypeError("two\nlines"), "disk": StoreError("no room")}[fails]

    monkeypatch.setattr(run_page, "write_page", stop)
    said = repaint("train-teacher", "--task", "reacher", *QUICK, "--run", "my run")
    assert (said.code, said.err) == (0, "")
    why = {"page": "two lines", "disk": "no room"}[fails]
    (line,) = [line for line in said.out.splitlines() if line.startswith("warning: ")]
    assert line == f"warning: there is no report.html: {why}; to try again: repaint open 'my run'"
    assert "wrote my run/: run.json" in said.out
    assert {"curves.png", "best.safetensors", "seed-0.safetensors"} <= {
        path.name for path in (home / "my run").iterdir()
    }
    assert (home / "home" / "zoo" / "reacher.safetensors").is_file()


def test_the_tables_of_a_comparison_are_its_numbers(repaint, two, home):
    assert repaint("compare", "one", "two", "--report", "report").code == 0
    page, comparison = Page(home / "report" / "report.html"), comparison_of(two, "scratch")
    scores, gaps, ladder, earlier, *times, alarms, settings = page.tables
    assert scores[0] == ["run", "seeds", "jump-start", "area", "area by steps", "best", "final"]
    for cells, row in zip(scores[1:], comparison.standings, strict=True):
        assert cells[0].strip() == row.label
        assert float(cells[3].split()[0]) == pytest.approx(row.area[0], rel=1e-3)
        assert float(cells[5]) == pytest.approx(row.best, rel=1e-3)
    (against,) = [row.against for row in comparison.standings if row.against]
    assert gaps[1][0].strip() == "repaint from gentle"
    assert float(gaps[1][1].split()[0]) == pytest.approx(against.area.mean[0], rel=1e-3)
    assert gaps[1][2] == "0.25"
    assert gaps[1][5] == "3"  # pairs
    first, taught = comparison.standings
    assert ladder[0] == earlier[0] == ["run", *map(target_name, first.targets)]
    assert [float(cell.split()[0]) for cell in ladder[2][1:]] == [
        pytest.approx(one.k[0], rel=1e-2) for one in taught.targets
    ]
    assert [cell.rpartition(" p = ")[2] for cell in earlier[1][1:]] == [
        f"{one.p:.2g}" for one in taught.targets
    ]
    assert len(times) == len(page.data["targets"]) > 4
    names = ["run", "K", "K reduced", "time reduced", "steps", "time", "each seed's K"]
    for table, target in zip(times, page.data["targets"], strict=True):
        assert table[0] == names
        for cells, run in zip(table[1:], two.values(), strict=True):
            reached = run.returns.mean(0) >= target - 1e-4
            k = str(1 + reached.argmax()) if reached.any() else "never"
            assert cells[1] == k
            assert cells[4] == ("-" if k == "never" else f"{1000 * int(k):,}")
    shown = [one for one in page.each("div") if "data-target" in one and "hidden" not in one]
    assert [page.data["targets"][int(one["data-target"])] for one in shown] == [
        pytest.approx(comparison.target, rel=1e-5)
    ]
    assert alarms[1:] == [
        ["repaint from gentle", "2", "nothing-kept", "no teacher sample was kept"]
    ]
    assert settings[1:] == [
        ["method", "scratch", "repaint"],
        ["teachers", "none", "gentle"],
        ["ppo.gamma", "0.99", "0.9"],
    ]
    assert "the best mean of scratch" in page.words
    assert "repaint from gentle is probably ahead of scratch" in page.words
    assert "3 seeds: p cannot be below 0.25" in page.words
    assert "By this measure two runs like scratch, with 3 seeds each, give “never”" in page.words
    assert len(page.each("img")) == 2  # K(target) and profiles
    assert "repaint compare one two --report report" in page.words


def test_the_page_of_a_run_offers_round_targets(two):
    run = two["scratch"]
    comparison = comparison_of({"scratch": run}, None)
    found = page_tables.targets({"scratch": run}, comparison)
    low, step = found["levels"][0], found["levels"][1] - found["levels"][0]
    assert found["levels"] == pytest.approx(
        np.arange(low, low + 7.9 * step, step)[: len(found["levels"])]
    )
    assert low - step <= run.returns[:, 0].mean() < low
    assert found["levels"][-1] <= comparison.standings[0].best < found["levels"][-1] + step
    assert 3 <= len(found["levels"]) <= page_tables.LEVELS + 1
    assert found["chosen"] == len(found["levels"]) - 1
    assert found["heads"] == ["run", "K", "steps", "time", "each seed's K"]
    flat = write_run(run.folder / "flat", [[3.0, 3.0]])
    found = page_tables.targets({"flat": flat}, comparison_of({"flat": flat}, None))
    assert found["levels"] == [3.0]


def test_every_column_of_numbers_leads_to_what_it_means(two):
    comparison = comparison_of(two, "scratch")
    heads = page_tables.scores(comparison)[0] + page_tables.targets(two, comparison)["heads"]
    heads += page_tables.differences(comparison)[0]
    assert set(heads) - {"run"} <= MEANING_OF.keys()
    assert set(MEANING_OF.values()) <= {anchor for anchor, *_ in GLOSSARY}
    named = " ".join(name for _, name, _ in GLOSSARY)
    for word in ("β", "ζ", "K", "Area", "Jump-start", "p", "Seed"):
        assert word in named


def test_curves_have_means_intervals_and_what_they_go_over(two):
    scratch, taught = curves_json(two, [])["runs"]
    returns = two["scratch"].returns
    assert scratch["up"]["return"]["mean"] == pytest.approx(returns.mean(0), rel=1e-4)
    low, mean, high = (np.array(scratch["up"]["return"][n]) for n in ("low", "mean", "high"))
    assert ((low < mean) & (mean < high)).all()
    assert np.array(scratch["up"]["return"]["seeds"]).shape == (3, 20)
    assert scratch["across"]["env_steps"][:2] == [1000, 2000]
    assert scratch["across"]["seconds"][:2] == [1.5, 3]
    assert (scratch["taught"], taught["taught"]) == (-1, 5)
    assert scratch["up"].keys() == {"return"}
    assert taught["up"]["kept"]["mean"] == [0.5] * 6 + [None] * 14
    assert scratch["light"] == "#000000" != scratch["dark"]


def test_one_seed_has_no_interval_and_long_runs_fewer_points(home):
    run = write_run(home / "long", climb(1, 3000), "repaint", ["gentle"], taught=7)
    (curve,) = curves_json({"repaint": run}, [])["runs"]
    points = curve["across"]["iteration"]
    assert MOST_POINTS <= len(points) <= MOST_POINTS + 1
    assert (points[0], points[-1], points[curve["taught"]]) == (1, 3000, 7)
    assert set(curve["up"]["return"]["low"]) == {None}
    assert "Of 3,000 iterations" not in page_curves.note_of({"repaint": run})
    assert "of 3,000 iterations 400 are drawn" in page_curves.note_of({"repaint": run})


def test_runs_of_one_colour_have_other_dashes(home):
    runs = {f"runs/{i}": write_run(home / str(i), climb(1, 3)) for i in range(9)}
    looks = {(curve["light"], curve["dash"]) for curve in curves_json(runs, [])["runs"]}
    assert len(looks) == 9


def test_settings_of_a_run_beside_its_card_and_the_defaults(two, home):
    heads, rows = chosen_settings(two["repaint from gentle"])
    assert heads == ["setting", "this run", "its card", "default", "meaning"]
    named = {row[0]: row[1:] for row in rows}
    assert named["ppo.gamma"] == ["0.9", "0.99", "0.99", "γ, the discount per step."]
    assert "ppo.gae_lambda" not in named
    assert "env.id" not in named  # has no default, and is the card's
    own = write_run(home / "own", climb(), name="mine")
    heads, rows = chosen_settings(own)
    assert heads == ["setting", "this run", "default", "meaning"]
    assert ["env.simulator", "gymnasium"] in [row[:2] for row in rows]


def test_runs_with_the_same_settings_differ_in_nothing(two, home):
    again = write_run(home / "again", climb())
    assert differing_settings({"one": two["scratch"], "two": again})[1] == []


def test_films_and_pictures_are_in_the_page_if_small_else_linked(two, home, monkeypatch):
    run = two["scratch"]
    for name in ("trajectories", "heatmap", "curves"):
        draw(run.folder / f"{name}.png")
    (run.folder / "broken.png").write_bytes(b"no picture")
    (run.folder / "elsewhere.png").symlink_to(run.folder / "heatmap.png")
    run.files.film.write_bytes(b"film")
    page = Page(write_run_page(run))
    assert len(page.each("img")) == 2
    assert page.each("video")[0]["src"] == "data:video/mp4;base64,ZmlsbQ=="
    monkeypatch.setattr(page_files, "LARGEST", 3)
    repaint_cli.compare([run.folder], report=home / "a b" / "report")
    page = Page(home / "a b" / "report" / "report.html")
    links = [one["href"] for one in page.each("a") if "one" in one["href"]]
    assert links == ["../../one/video.mp4", "../../one/trajectories.png"]
    assert not page.each("video")


def test_open_prints_the_page_and_shows_it_where_there_is_a_display(
    repaint, two, home, monkeypatch
):
    shown = []
    monkeypatch.setattr("webbrowser.open", shown.append)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(open_command.sys, "platform", "linux")
    assert repaint("open", "one").out == "one/report.html\n"
    assert not shown
    monkeypatch.setenv("DISPLAY", ":0")
    assert repaint("open", "one").out == "one/report.html\n"
    assert shown == [(home / "one" / "report.html").as_uri()]
    repaint("compare", "one", "two", "--report", "report")
    assert repaint("open", "report").out == "report/report.html\n"
    assert shown[1:] == [(home / "report" / "report.html").as_uri()]


def test_open_shows_the_newest_run_and_what_came_later(repaint, home, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    run = write_run(home / "runs" / "reacher" / "x", climb())
    run.files.checkpoint.write_bytes(b"")
    path = home / repaint("open").out.strip()
    assert not Page(path).each("video")
    run.files.film.write_bytes(b"film")
    repaint("open")
    assert len(Page(path).each("video")) == 1


def test_open_says_what_it_cannot_show(repaint, home):
    said = repaint("open", "nothing")
    assert (said.code, said.out) == (NotFound.exit_code, "")
    assert said.err == "error: expected a run's folder with run.json, found none at nothing\n"
    write_run(home / "empty", np.empty((1, 0)))
    said = repaint("open", "empty")
    assert said.code == CardError.exit_code
    assert said.err == "error: expected a run with a finished iteration, found none in empty\n"
    assert said.err.count("\n") == 1


def test_a_page_in_a_folder_that_cannot_be_written_is_shown_as_it_is(two, home, monkeypatch):
    def full(*_):
        raise StoreError("no room")

    path = write_run_page(two["scratch"])
    before = path.read_bytes()
    monkeypatch.setattr(run_page, "write_page", full)
    assert fresh_page(home / "one") == path
    assert path.read_bytes() == before
    with pytest.raises(StoreError, match="no room"):
        fresh_page(home / "two")


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_numbers_that_are_none_leave_gaps(two, number):
    run = two["repaint from gentle"]
    run.rows["seconds"][:] = run.rows["kept_fraction"][0, 0] = number
    page = Page(write_run_page(run))
    (curve,) = page.data["runs"]
    assert curve["across"]["seconds"] == [None] * 20
    assert curve["up"]["kept"]["mean"][:2] == [None, 0.5]
    assert "nan" not in page.words


def test_the_same_run_has_the_same_page(two):
    first = write_run_page(two["scratch"]).read_bytes()
    assert write_run_page(two["scratch"]).read_bytes() == first


def test_a_report_replaces_its_own_page_and_no_other(repaint, two, home):
    assert repaint("compare", "one", "two", "--report", "report").code == 0
    assert repaint("compare", "one", "two", "--report", "report").code == 0
    (home / "other").mkdir()
    (home / "other" / "report.html").write_text("<p>mine</p>")
    said = repaint("compare", "one", "two", "--report", "other")
    assert said.code == StoreError.exit_code
    assert "other/report.html is there and was not written by repaint" in said.err
    assert (home / "other" / "report.html").read_text() == "<p>mine</p>"
