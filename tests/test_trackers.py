"""W&B and MLflow beside a run: the same numbers, one run of theirs over resumes, no harm done."""

import importlib.util
import json
import sys

import pytest
from fake_trackers import FakeTool, fake_mlflow, fake_wandb
from test_runs import SCRATCH, rows_of

from repaint_cli.runs.trackers.tracker import TRACKERS, tracker_class

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

MORE = ["transfer", "--resume", "run", "--iterations"]
TWO = [*SCRATCH, "--seeds", 2]


@pytest.fixture(params=["wandb", "mlflow"])
def name(request):
    return request.param


@pytest.fixture
def tool(name, monkeypatch):
    tool = FakeTool()
    modules = fake_wandb(tool) if name == "wandb" else fake_mlflow(tool)
    for module in modules.items():
        monkeypatch.setitem(sys.modules, *module)
    return tool


def wanted(folder):
    rows = rows_of(folder)
    return {
        seed: {
            int(row["iteration"]): pytest.approx(float(row["eval_return"]), rel=1e-5)
            for row in rows if int(row["seed"]) == seed
        }
        for seed in (0, 1)
    }  # fmt: skip


def test_a_run_for_each_seed_has_the_numbers_and_the_settings(repaint, home, name, tool):
    said = repaint(*TWO, "--track", name)
    assert (said.code, said.err) == (0, "")
    assert "Tracking run" not in said.out
    assert f"{name}.json" in said.out.splitlines()[-2]
    assert tool.returns() == wanted(home / "run")
    for run in tool.runs.values():
        assert run["states"] == ["running", 0]
        assert "run seed-" in run["name"]
        config = run["config"]
        n_steps = (
            config["task"]["ppo"]["n_steps"] if name == "wandb" else config["task.ppo.n_steps"]
        )
        assert int(n_steps) == 204


def test_a_resumed_run_goes_on_in_the_same_run(repaint, home, name, tool):
    repaint(*TWO, "--track", name)
    assert repaint(*MORE, 3).code == 0
    assert len(tool.runs) == 2
    assert [run["states"][-2:] for run in tool.runs.values()] == [["running", 0]] * 2
    assert tool.returns() == wanted(home / "run")
    kept = json.loads((home / "run" / f"{name}.json").read_text())
    assert (set(kept["ids"].values()), kept["iteration"]) == ({*tool.runs}, 3)


def test_a_run_that_is_tracked_late_is_tracked_from_its_beginning(repaint, home, name, tool):
    repaint(*TWO)
    repaint(*MORE, 3, "--track", name)
    assert tool.returns() == wanted(home / "run")


@pytest.mark.parametrize("call", ["begin", "log", "end"])
def test_a_tracker_that_fails_is_one_line_and_gets_its_numbers_later(
    repaint, home, name, tool, call
):
    tool.fails[call] = ConnectionError("no network\nTraceback …")
    said = repaint(*TWO, "--track", name)
    assert said.code == 0
    title = tracker_class(name).title
    assert said.err == f"warning: the run goes on without {title}: no network\n"
    assert tool.calls.count(call) == 1
    assert len(rows_of(home / "run")) == 4
    tool.fails.clear()
    assert repaint(*MORE, 3, "--track", name).err == ""
    assert {s: r for s, r in tool.returns().items() if r} == wanted(home / "run")


def test_ids_that_are_damaged_or_gone_begin_anew(repaint, home, name, tool):
    repaint(*TWO, "--track", name)
    (home / "run" / f"{name}.json").write_text('{"ids": 3')
    tool.runs.clear()
    repaint(*MORE, 3)
    assert tool.returns() == wanted(home / "run")


def test_runs_that_are_in_no_store_any_more_begin_anew(repaint, home, tool, name):
    if name == "wandb":
        pytest.skip("W&B makes a run with the kept id, without the earlier steps")
    repaint(*TWO, "--track", name)
    tool.runs.clear()
    repaint(*MORE, 3)
    assert tool.returns() == wanted(home / "run")


def test_ctrl_c_ends_the_tracked_runs_too(repaint, home, name, tool):
    tool.fails["log"] = KeyboardInterrupt()
    assert repaint(*TWO, "--track", name).code == 130
    assert {run["states"][-1] for run in tool.runs.values()} == {1}


@pytest.mark.parametrize("tool_name", [*TRACKERS])
def test_what_is_not_installed_is_named_before_anything_is_made(
    repaint, home, monkeypatch, tool_name
):
    monkeypatch.setattr("repaint_cli.runs.trackers.tracker.find_spec", lambda _: None)
    said = repaint(*SCRATCH, "--track", tool_name)
    title = tracker_class(tool_name).title
    line = f"error: --track {tool_name} needs {title}: pip install {tool_name}\n"
    assert (said.code, said.err) == (1, line)
    assert not (home / "run").exists()


def test_a_tool_that_is_not_known_is_refused(repaint, home):
    said = repaint(*SCRATCH, "--track", "comet")
    assert (said.code, said.err) == (
        2, "error: expected --track tensorboard, wandb, mlflow, found 'comet'\n",
    )  # fmt: skip
    assert not (home / "run").exists()


@pytest.mark.parametrize(("mode", "begun"), [("online", 0), ("offline", 1), ("disabled", 1)])
def test_without_a_login_only_offline_is_tracked(repaint, monkeypatch, mode, begun):
    tool = FakeTool()
    monkeypatch.setitem(sys.modules, "wandb", fake_wandb(tool, mode, logged_in=False)["wandb"])
    said = repaint(*SCRATCH, "--track", "wandb")
    assert said.code == 0
    assert len(tool.runs) == begun
    assert ("nobody is logged in: wandb login, or export WANDB_MODE=offline" in said.err) != begun


def test_all_three_at_once(repaint, home, monkeypatch):
    pytest.importorskip("tensorboard", reason="needs TensorBoard")
    tools = FakeTool(), FakeTool()
    for module in (fake_wandb(tools[0]) | fake_mlflow(tools[1])).items():
        monkeypatch.setitem(sys.modules, *module)
    said = repaint(*TWO, "--track", "wandb", "--track", "mlflow", "--tensorboard")
    assert said.code == 0
    assert tools[0].returns() == tools[1].returns() == wanted(home / "run")
    assert (home / "run" / "tensorboard" / "seed-1").is_dir()


# With the tools themselves, where they are installed: files alone, no network


def installed(name):
    return importlib.util.find_spec(name) is not None


@pytest.mark.skipif(not installed("mlflow"), reason="needs MLflow")
def test_the_real_mlflow_has_the_numbers(repaint, home, monkeypatch):
    from mlflow.tracking import MlflowClient

    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{home}/mlflow.db")
    repaint(*TWO, "--track", "mlflow")
    assert repaint(*MORE, 3).err == ""
    client = MlflowClient()
    ids = json.loads((home / "run" / "mlflow.json").read_text())["ids"]
    for seed, name in ids.items():
        history = client.get_metric_history(name, "eval_return")
        assert {point.step: point.value for point in history} == wanted(home / "run")[int(seed)]


@pytest.mark.skipif(not installed("wandb"), reason="needs W&B")
def test_the_real_wandb_writes_offline_into_the_runs_folder(repaint, home, monkeypatch):
    monkeypatch.setenv("WANDB_MODE", "offline")
    said = repaint(*SCRATCH, "--track", "wandb")
    assert said.err == ""
    assert list((home / "run" / "wandb").glob("offline-run-*/*.wandb"))
    assert {path.name for path in home.iterdir()} <= {"run", "home"}
