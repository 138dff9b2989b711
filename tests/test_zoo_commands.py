"""What else one does with a zoo: verify, remove, export, publish."""

import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import REACHER, add_teacher

from repaint_cli.errors import CheckpointError, StoreError
from repaint_cli.policies.spaces import Spaces
from repaint_cli.policies.weights import load, save
from repaint_cli.zoo import store, verify

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at


@pytest.fixture
def folder(home):
    return home / "home" / "zoo"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"n_actions": 3},
            r"leaf 'policy.head.weight' is \(64, 2\) float32 in the file, \(64, 3\)",
        ),
        ({"task": {"reward": {"nothing": 1.0}}}, "its own task cannot be played: .*'nothing'"),
        ({"task": {"env": {"id": "Nowhere-v0"}}}, "its own task cannot be played: .*Nowhere-v0"),
    ],
)
def test_verify_holds_a_card_against_weights_and_task(repaint, folder, changes, message):
    path = add_teacher(folder)
    tensors, card = load(path)
    for name, value in changes.items():
        card[name] = card[name] | value if isinstance(value, dict) else value
        if name == "task" and "env" in value:
            card["task"]["env"] = {"simulator": "gymnasium", **value["env"]}
    save(path, tensors, card)
    said = repaint("zoo", "verify", "old-hand")
    assert said.code == 5
    assert re.search(message, said.err), said.err


def test_verify_finds_a_policy_of_another_task(folder):
    path = add_teacher(folder, spaces=Spaces((4,), 3, True))
    with pytest.raises(CheckpointError, match=r"it has 4 observations and 3 discrete .*own"):
        verify.verify(path)


def test_verify_can_measure_the_score_again(repaint, home, folder):
    path = add_teacher(folder, settings=["eval.episodes=2"])
    said = repaint("zoo", "verify", "old-hand", "--score")
    assert said.out.startswith("old-hand: sound; its card has no score, measured -")
    network, card = store.read_teacher(path)
    honest = verify.score(network, card.task, card.seed)
    store.add(network, 0, card.model_copy(update={"score": honest}), folder)
    said = repaint("zoo", "verify", "old-hand", "--score")
    assert said.out == (
        f"old-hand: sound; score {honest.mean:.4g} [{honest.low:.4g}, {honest.high:.4g}], "
        f"its card says {honest.mean:.4g}\n"
    )
    boasting = honest.model_copy(update={"mean": 0.0, "low": -1.0, "high": 1.0})
    store.add(network, 0, card.model_copy(update={"score": boasting}), folder)
    said = repaint("zoo", "verify", "old-hand", "--score")
    assert said.code == 5
    assert f"its card says a score of 0 [-1, 1], measured {honest.mean:.4g}" in said.err


def test_remove_asks(repaint, folder, monkeypatch):
    add_teacher(folder)
    answers = iter("ny")
    monkeypatch.setattr("typer.confirm", lambda *_, **__: next(answers) == "y")
    said = repaint("zoo", "remove", "old-hand")
    assert (said.code, said.out) == (0, "nothing removed\n")
    assert (folder / "old-hand.safetensors").is_file()
    assert repaint("zoo", "remove", "old-hand").code == 0
    assert not list(folder.iterdir())
    said = repaint("zoo", "remove", "racer-inner", "--yes")
    assert said.code == StoreError.exit_code
    assert "'racer-inner' comes with repaint; only your own teachers can be removed" in said.err


def test_nobody_to_ask_is_no_yes(home, folder):
    add_teacher(folder)
    words = [sys.executable, "-m", "repaint_cli", "zoo", "remove", "old-hand"]
    done = subprocess.run(
        words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert done.stderr.endswith(
        "error: expected an answer, and there is nobody to ask; try --yes\n"
    )
    assert (folder / "old-hand.safetensors").is_file()


CAMERA = Spaces((120, 160, 1), 10, True)
SEES = [
    ("reacher", REACHER, ()),
    ("reacher", REACHER, ("net.obs_normalize=false", "net.obs_clip=0.1")),
    ("cartpole", Spaces((4,), 2, True), ()),
    ("racer-inner", Spaces((120, 160, 1), 10, True), ("net.dense=32",)),
    ("racer-inner", Spaces((120, 160, 1), 10, True), ("net.dense=32", "net.precision=bf16")),
    ("racer-avoid", Spaces((120, 160, 1), 10, True, 64), ("net.dense=32",)),
    ("racer-inner", replace(CAMERA, parts=(("picture", CAMERA.obs_shape),)), ("net.dense=32",)),
    (
        "racer-inner",
        Spaces(
            (40, 60, 1), 5, True, parts=(("near", (40, 60, 1)), ("numbers", (3,))), sizes=(2, 3),
            uses=((True,), (False,)),
        ),
        ("net.dense=32", "net.conv=[[4,4,2]]"),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("task", "spaces", "settings"), SEES)
def test_an_exported_policy_is_the_same_in_onnx(repaint, home, folder, task, spaces, settings):
    onnxruntime = pytest.importorskip("onnxruntime")
    path = add_teacher(
        folder, task=task, spaces=spaces, settings=settings, n_beams=spaces.n_beams,
        parts=dict(spaces.parts), sizes=spaces.sizes, uses=spaces.uses,
    )  # fmt: skip
    said = repaint("zoo", "export", "old-hand", "out", "--onnx")
    assert said.code == 0
    assert "wrote out/: old-hand.safetensors, card.json, README.md, old-hand.onnx\n" in said.out
    assert (home / "out" / "old-hand.safetensors").read_bytes() == path.read_bytes()
    card = json.loads((home / "out" / "card.json").read_text())
    session = onnxruntime.InferenceSession(str(home / "out" / "old-hand.onnx"))
    assert json.loads(session.get_modelmeta().custom_metadata_map["repaint"]) == card
    network, _ = store.read_teacher(path)
    rng = np.random.default_rng(0)
    for n in (1, 7):
        feed, seen = {}, {}
        for name, shape in spaces.shapes.items():
            obs = rng.random((n, *shape), dtype=np.float32)
            if len(shape) == 3:
                obs = rng.integers(0, 256, obs.shape, dtype=np.uint8)
            feed["obs" if name in ("", "camera") else name] = obs
            seen[name] = torch.from_numpy(obs).unsqueeze(0)
        seen = seen.get("", seen)
        found = session.run(None, feed)
        policy = network.in_precision("float32").policy(seen)  # as every runtime has it
        wanted = [policy.log_probs] if spaces.discrete else [policy.mean, policy.log_std[0]]
        for ours, theirs in zip(wanted, found, strict=True):
            np.testing.assert_allclose(theirs, ours[0].detach().numpy(), rtol=1e-5, atol=1e-5)


def test_the_page_of_a_teacher_says_what_its_card_says(repaint, folder):
    add_teacher(folder, env_steps=12345, parents=("f" * 64,))
    page = repaint("zoo", "show", "old-hand", "--markdown").out
    for text in (
        "# old-hand\n", "12,345 environment steps", "`ffffffffffff…`", "Reacher-v5",
        "| reward_ctrl | 1.0 |", "**Score**: not measured.", "| hidden | [64, 64] |",
    ):  # fmt: skip
        assert text in page


def test_a_card_in_ten_lines_of_80_columns(repaint, home):
    add_teacher(home / "home" / "zoo", "a" * 64, settings=["ppo.gamma=0.9"])
    said = repaint("zoo", "show", "a" * 64)
    lines = said.out.splitlines()
    assert (said.code, len(lines)) == (0, 10)
    assert max(map(len, lines[:-1])) <= 80
    assert lines[0] == f"teacher    {'a' * 64}, yo…"
    assert lines[-1] == f"next: repaint zoo show {'a' * 64} --json"
    lines = repaint("zoo", "show", "racer-avoid").out.splitlines()
    assert lines[0] == "teacher    racer-avoid, shipped"
    assert lines[2].startswith("score      1048 [811.2, 1278] over 20 episodes, 7 laps")
    assert lines[3] == "reward     4 clear - 4 hazard"
    assert json.loads(repaint("zoo", "show", "racer-avoid", "--json").out)["seed"] == 7
