"""`repaint zoo add`: a policy's file becomes a teacher, from training there to transfer here."""

import re
from pathlib import Path

import numpy as np
import torch
from small_runs import QUICK, add_teacher, files_below, weights_of

from repaint_cli.errors import UsageError
from repaint_cli.files.paths import PACKAGE
from repaint_cli.tasks.task import Task
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import read_card


def refused(repaint, code, message, *words):
    before = files_below(Path())
    said = repaint("zoo", "add", *words)
    assert re.search(message, said.err), said.err
    assert (said.err.count("\n"), said.out, said.code) == (1, "", code)
    assert files_below(Path()) == before


def test_a_teachers_file_is_added_under_another_name(repaint, home):
    path = add_teacher(home / "elsewhere", "old-hand")
    said = repaint("zoo", "add", "new-name", path)
    assert said.code == 0, said.err
    assert "new-name.safetensors" in said.out
    assert "next: repaint transfer --teacher new-name --task reacher" in said.out
    found = store.find("new-name")
    assert found.parent == home / "home" / "zoo"
    assert read_card(found) == read_card(path).model_copy(update={"name": "new-name"})
    old, new = weights_of(path), weights_of(found)
    assert all(torch.equal(old[name], new[name]) for name in old)
    assert repaint("zoo", "verify", "new-name").out == "new-name: sound\n"


def test_a_name_is_taken_once(repaint, home):
    path = add_teacher(home / "elsewhere", "old-hand")
    assert repaint("zoo", "add", "mine", path).code == 0
    refused(
        repaint, 7, "a teacher 'mine' already; give another name, or --replace it", "mine", path
    )
    other = add_teacher(home / "elsewhere", "other", env_steps=77)
    assert repaint("zoo", "add", "mine", other, "--replace").code == 0
    assert read_card(store.find("mine")).env_steps == 77
    refused(repaint, 7, "expected a teacher's name of 1 to 64", "not/mine", path)


def test_options_that_do_not_go_together_and_files_that_are_not_there(repaint, home):
    path = add_teacher(home / "elsewhere", "old-hand")
    beside = "expected --from sb3 or cleanrl beside --{}, found none"
    refused(repaint, UsageError.exit_code, beside.format("task"), "a", path, "--task", "reacher")
    refused(
        repaint,
        UsageError.exit_code,
        beside.format("vecnormalize"),
        "a",
        path,
        "--vecnormalize",
        "none",
    )
    refused(
        repaint,
        UsageError.exit_code,
        "expected the --task that .* was trained on",
        "a",
        path,
        "--from",
        "sb3",
    )
    task = ["--task", "reacher"]
    message = r"unknown source 'sb'; did you mean sb3\? see: repaint zoo add --help"
    refused(repaint, 2, message, "a", path, "--from", "sb", *task)
    refused(repaint, 2, "unknown task 'reachr'", "a", path, "--from", "sb3", "--task", "reachr")
    refused(repaint, 5, "not a whole zip file", "a", path, "--from", "sb3", *task)
    refused(repaint, 5, "not as torch.save writes", "a", path, "--from", "cleanrl", *task)
    refused(repaint, 5, "cannot read x.zip: No such file", "a", "x.zip", "--from", "sb3", *task)
    refused(repaint, 5, "expected a safetensors file at x.zip, found none", "a", "x.zip")


def test_a_policy_trained_elsewhere_is_added_verified_and_taught_by(repaint, home, monkeypatch):
    import gymnasium
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    venv = VecNormalize(DummyVecEnv([lambda: gymnasium.make("Reacher-v5")]))
    model = PPO("MlpPolicy", venv, n_steps=128, batch_size=64, seed=1, device="cpu")
    model.learn(384)
    model.save("model.zip")
    venv.save("vec.pkl")
    command = ["zoo", "add", "guest", "model.zip", "--from", "sb3", "--task", "reacher"]
    refused(repaint, UsageError.exit_code, "saw normalised observations", *command[2:])
    make_env, made = Task.make_env, []
    monkeypatch.setattr(
        Task, "make_env", lambda task, n, **how: made.append(n) or make_env(task, n, **how)
    )
    said = repaint(*command, "--vecnormalize", "vec.pkl")
    assert said.code == 0, said.err
    assert made == [1, 100]  # one to see what fits, and those of the score
    assert re.search(r"score on reacher: -\d+\.?\d* \[-.*\] over 100 episodes", said.out)
    assert repaint("zoo", "verify", "guest").out == "guest: sound\n"
    assert "guest" in repaint("zoo", "list", "--fits", "reacher").out
    card = read_card(store.find("guest"))
    assert (card.method, card.seed, card.env_steps) == ("imported", 1, 384)

    network, _ = store.read_teacher(store.find("guest"))
    obs = np.random.default_rng(0).normal(size=(200, 10)).astype(np.float32)
    actions, _ = model.predict(venv.normalize_obs(obs), deterministic=True)
    with torch.no_grad():
        found = network.policy(torch.from_numpy(obs)[None]).mode()[0].numpy().clip(-1, 1)
    assert np.abs(found - actions).max() <= 1e-6

    student = ["transfer", "--task", "reacher", "--teacher", "guest", *QUICK, "--iterations", 1]
    assert repaint(*student, "--run", "first").code == 0
    said = repaint(*student, "--method", "warm-start", "--run", "second")
    assert "try --set net.obs_clip=10.0" in said.err
    same = ["--set", "net.obs_clip=10", "--set", "net.obs_min_std=0"]
    said = repaint(*student, "--method", "warm-start", *same, "--run", "second")
    assert said.code == 0, said.err


def test_a_warm_start_from_a_policy_that_normalises_nothing_takes_one_setting(repaint, home):
    import gymnasium
    from stable_baselines3 import PPO

    PPO("MlpPolicy", gymnasium.make("Reacher-v5"), seed=1, device="cpu").save("model.zip")
    command = ["zoo", "add", "guest", "model.zip", "--from", "sb3", "--task", "reacher"]
    assert repaint(*command).code == 0
    student = ["transfer", "--task", "reacher", "--teacher", "guest", "--method", "warm-start"]
    said = repaint(*student, *QUICK, "--iterations", 1)
    assert "has net.obs_normalize false, task 'reacher' has true; try --set " in said.err
    raw = ["--set", "net.obs_normalize=false"]
    said = repaint(*student, *QUICK, "--iterations", 1, *raw)
    assert said.code == 0, said.err


def test_a_teacher_of_other_networks_is_trained_and_comes_back(repaint, home):
    net = ["net.activation=relu", "net.hidden=[16]", "net.value_hidden=[8,8]", "net.obs_clip=none"]
    settings = [word for setting in net for word in ("--set", setting)]
    said = repaint("train-teacher", "--task", "reacher", "--name", "other", *QUICK, *settings)
    assert said.code == 0, said.err
    network, card = store.read_teacher(store.find("other"))
    assert network.weights["value.1.weight"].shape == (1, 8, 8)
    assert (card.task.net.activation, card.task.net.obs_clip) == ("relu", "none")


HAZARDS = (
    r"^\s*(import|from) (pickle|cloudpickle|dill|marshal|shelve)\b",
    r"\bpickle\.loads?\(",
    r"\bcloudpickle\.",
    r"\bjoblib\.load\(",
    r"allow_pickle=True",
    r"weights_only=False",
    r"\bread_pickle\(",
)


def test_nothing_opens_a_pickle():
    loads = []
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        for hazard in HAZARDS:
            assert not re.search(hazard, text, re.MULTILINE), f"{path} has {hazard}"
        for call in re.findall(r"\b(?:torch|np|numpy)\.load\((?:[^()]|\([^()]*\))*\)", text):
            loads.append((path.name, call))
            assert "weights_only=True" in call or "allow_pickle=False" in call, call
    assert [name for name, call in loads if call.startswith("torch")] == ["archives.py"]
