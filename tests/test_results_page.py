"""docs/results.md and the CSVs of experiments: the one is made from the others."""

import json
import shutil
import sys
from pathlib import Path

import pytest
from written_runs import climb, write_run

from repaint_cli.errors import StoreError
from repaint_cli.experiments.files import list_experiments
from repaint_cli.experiments.folder import ExperimentFolder, record_of
from repaint_cli.experiments.planning import plan_experiment
from repaint_cli.experiments.results import MeasuredPanel, write_curves

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "tools"))
import results  # noqa: E402

REACHER = next(one for one in list_experiments() if one.name == "reacher")


def test_the_page_is_what_the_committed_curves_give():
    page = results.PAGE.read_text(encoding="utf-8")
    assert results.with_section(page) == page, "run: python tools/results.py"


def test_every_committed_file_is_an_experiment_s():
    experiments = [*list_experiments(), *results.own_experiments()]
    known = {results.csv_of(one, scale).stem for one in experiments for scale in results.REAL}
    for path in results.RESULTS.glob("*"):
        assert path.stem in known
        assert path.suffix in (".csv", ".json", ".md")
        assert path.with_suffix(".csv").is_file()
        assert json.loads(path.with_suffix(".json").read_text())["scale"] != "smoke"


@pytest.fixture
def reproduced(tmp_path, monkeypatch):
    """The folder of an experiment that has been carried out, and an empty repository."""
    monkeypatch.setattr(results, "RESULTS", tmp_path / "results")
    planned = plan_experiment(REACHER, "night", tmp_path / "reproduce")
    folder = ExperimentFolder(planned.folder)
    panels = []
    for n, own in enumerate(planned.panels):
        runs = {
            name: write_run(tmp_path / f"{n}-{name}", climb(speed=3.0 + s), run.method)
            for s, (name, run) in enumerate(own.runs.items())
        }
        panels.append(MeasuredPanel("reacher", own.panel, runs))
    record_of(planned, finished=False).model_copy(update={"finished": True}).write(folder.record)
    write_curves(panels, folder.curves)
    return tmp_path / "reproduce"


def test_what_was_collected_is_on_the_page_with_its_command(reproduced):
    assert "### reacher, night" not in results.section()
    (path,) = results.collect(reproduced)
    assert path.name == "reacher.night.csv"
    path.with_suffix(".md").write_text("Ours are slower.\n")
    text = results.section()
    assert "### reacher, night (figure 1)" in text
    assert "`repaint reproduce reacher --scale night`: 10 seeds × 100 iterations, float32" in text
    row = next(line for line in text.splitlines() if line.startswith("| similar teacher (cosine"))
    assert "(173)" in row
    assert "| reacher | night |" not in text  # of what was not run
    assert "| reacher | paper |" in text
    assert text.count("\nOurs are slower.\n") == 1
    assert "| reacher: similar teacher (cosine 0.89) | -7.4 (-7.4) | " in text  # of table 1


def test_what_is_of_the_scale_smoke_is_no_result(reproduced):
    record = reproduced / "night" / "reacher" / "experiment.json"
    record.write_text(record.read_text().replace('"scale": "night"', '"scale": "smoke"'))
    with pytest.raises(StoreError, match="is of the scale smoke: no result"):
        list(results.collect(reproduced))
    shutil.move(reproduced / "night", reproduced / "smoke")
    assert not list(results.collect(reproduced))
