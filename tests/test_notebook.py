"""The notebook in docs/: it runs, shows its figures, and writes nothing but in a folder of its own.

What it needs is not among what `make test-light` installs, as it trains, which needs torch.
"""

import json
from pathlib import Path

import pytest

from repaint_cli.files.paths import PACKAGE

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")

DOCS = PACKAGE.parent / "docs"

SHAPES = """
import json
from matplotlib.image import imread
print(json.dumps({
    "cosine": pair.cosine,
    "distances": len(distances),
    "action": action.shape,
    "scratch": scratch.run.returns.shape,
    "student": student.run.returns.shape,
    "standings": len(compared.comparison.standings),
    "returns": returns.shape,
    "actions": evaluation.episodes.actions.shape,
    "curves": imread(compared.written[0]).shape,
    "paths": imread(evaluation.written[1]).shape,
    "lead": student.run.returns.mean() - scratch.run.returns.mean(),
    "label": student.run.label,
    "folder": folder.name,
}))
"""
"""A cell behind the last one: the sizes of what the others have left."""


@pytest.fixture
def notebook():
    return nbformat.read(DOCS / "transfer.ipynb", as_version=4)


def text_of(cell):
    """What a cell printed."""
    return "".join(output.get("text", "") for output in cell.outputs)


def test_it_is_stored_without_outputs_and_each_cell_is_introduced(notebook):
    nbformat.validate(notebook)
    code = [i for i, cell in enumerate(notebook.cells) if cell.cell_type == "code"]
    assert len(code) == 5
    for i in code:
        assert not notebook.cells[i].outputs
        assert notebook.cells[i].execution_count is None
        assert notebook.cells[i - 1].source.startswith("## ")


@pytest.mark.slow
def test_it_runs_and_shows_its_figures(notebook, tmp_path, monkeypatch):
    user = tmp_path / "user"
    scratch = tmp_path / "tmp"
    for folder in (user, scratch):
        folder.mkdir()
    monkeypatch.setenv("PYTHONPATH", str(PACKAGE.parent))
    monkeypatch.setenv("TMPDIR", str(scratch))
    monkeypatch.setenv("REPAINT_HOME", str(user / "home"))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "jupyter"))
    notebook.cells.append(nbformat.v4.new_code_cell(SHAPES))
    resources = {"metadata": {"path": str(user)}}  # where it is opened
    nbclient.NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources=resources
    ).execute()

    *cells, last = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not list(user.iterdir())
    assert not [
        output for cell in cells for output in cell.outputs if output.get("name") == "stderr"
    ]
    images = [
        [output for output in cell.outputs if "image/png" in output.get("data", {})]
        for cell in cells
    ]
    assert [len(shown) for shown in images] == [0, 0, 0, 1, 1]
    shapes = json.loads(text_of(last))
    place = Path(shapes.pop("folder"))
    assert scratch in place.parents
    assert not place.exists()  # its folder is gone with it
    for name in ("curves", "paths"):
        height, width, channels = shapes.pop(name)
        assert min(height, width) > 500
        assert channels in (3, 4)
    assert shapes.pop("lead") > 0
    assert shapes == {
        "cosine": pytest.approx(0), "distances": 50, "action": [2], "scratch": [3, 30],
        "student": [3, 30], "standings": 2, "returns": [3, 20], "actions": [50, 3, 20, 2],
        "label": "repaint auto from reacher-gentle",
    }  # fmt: skip
    assert "reacher-gentle → reacher: cosine 0.89, similar" in text_of(cells[0])
