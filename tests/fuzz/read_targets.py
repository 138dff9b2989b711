"""Every kind of file that other people may have written, undamaged, and its reader."""

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import damage
from small_learners import course_for, learner_of, spaces_of
from small_runs import REACHER, add_teacher, log_of
from small_tasks import reach
from test_simtrace import TASK, trace

from repaint_cli.cli.console import literal
from repaint_cli.envs.racer.deepracer.simtrace import TEXT_FILE
from repaint_cli.envs.racer.deepracer.simtrace_reader import read_episodes, read_training
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.files.paths import PACKAGE
from repaint_cli.policies import weights
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.runs import checkpoint
from repaint_cli.runs.comparison import comparison_of
from repaint_cli.runs.comparison_rows import as_row
from repaint_cli.runs.owner import new_run
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import read_run
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.card_text import to_toml
from repaint_cli.tasks.similarity import cosine, relation
from repaint_cli.tasks.task import RewardCode
from repaint_cli.zoo import store

RAN = "open('ran', 'w').close()\ndef reward_function(params): return 1.0\n"
OVAL = PACKAGE.parent / "tasks" / "racer" / "tracks" / "oval.npy"
CARD = {
    "extends": "racer-inner",
    "summary": "Mine.",
    "env": {
        "track": "mine.npy", "model_metadata": "model_metadata.json", "max_steps": 90,
    },
    "reward": {"progress": 1.0, "lane": -0.5},
    "net": {"conv": [[4, 8, 8]], "dense": 8},
    "ppo": {"hyperparameters": "hyperparameters.json", "n_episodes": 4, "gamma": 0.9},
    "transfer": {"kickstart_coef": [0.2, 0.1]},
}  # fmt: skip
METADATA = {
    "action_space": [{"steering_angle": -20, "speed": 1.5}, {"steering_angle": "20", "speed": 1}],
    "sensor": ["FRONT_FACING_CAMERA", "LIDAR"],
    "version": "4",
}
HYPERPARAMETERS = {"batch_size": 64, "lr": "0.0003", "num_epochs": 10, "loss_type": "huber"}


@dataclass
class Target:
    """A file that somebody else may have written, and who reads it."""

    path: Path
    read: Any
    cases: Any
    """From the sound file's bytes to a strategy for others."""
    sound: bytes = b""

    def __post_init__(self):
        if self.path.suffix == ".safetensors":
            damage.forget_hash(self.path)
        self.sound = self.path.read_bytes()


def teacher_targets(folder):
    def read(path):
        network, card = store.read_teacher(path, 2)
        assert network.spaces == card.spaces
        own = read_task("reacher")
        relations = (
            store.mismatch(card, own, REACHER),
            cosine(card.task, own),
            relation(own, card.task),
        )
        assert literal(relations)

    vector = add_teacher(folder, settings=["net.hidden=[8,8]"])
    seeing = add_teacher(
        folder, "seeing", "racer-inner", Spaces((120, 160, 1), 10, True),
        ["net.conv=[[2,8,8]]", "net.dense=4"],
    )  # fmt: skip
    tensors, card = weights.load(seeing)
    card["task"] |= {
        "reward": {"function": 1.0},
        "reward_code": RewardCode(name="fuzz/damage.py", source=RAN).model_dump(),
    }
    weights.save(seeing, tensors, card)
    return {
        f"teacher {path.stem}": Target(path, partial(read, path), damage.safetensors_cases)
        for path in (vector, seeing)
    }


def run_targets(folder):
    task = reach()
    with new_run(Plan(task, "scratch", [0, 1], folder)) as experiment:
        for _ in experiment.run():
            pass

    def read():
        run = read_run(folder)
        assert run.taught_until >= 0
        if run.returns.size and (run.progress is None or run.progress.size):
            found = comparison_of({run.label: run}, run.label)
            assert json.dumps([as_row(row) for row in found.standings])

    path = folder / "checkpoint.safetensors"

    def checkpoint_read():
        like, learner = (spaces_of(task), task.net, 2), learner_of(task, [0, 1])
        try:
            checkpoint.load_learner(path, learner, course_for(task, learner))
        finally:
            weights.check_networks(path, *like, str(path), checkpoint.NETWORKS)
            checkpoint.load_networks(path, ActorCritic(*like))

    kinds = {
        "run.json": (read, damage.json_cases),
        "metrics.csv": (read, damage.csv_cases),
        "checkpoint.safetensors": (checkpoint_read, lambda data: damage.safetensors_cases(data)),
    }
    return {name: Target(folder / name, *kind) for name, kind in kinds.items()}


def card_targets(folder):
    folder.mkdir()
    (folder / "card.toml").write_bytes(damage.as_toml(CARD))
    (folder / "mine.npy").write_bytes(OVAL.read_bytes())
    (folder / "model_metadata.json").write_text(json.dumps(METADATA, indent=1))
    (folder / "hyperparameters.json").write_text(json.dumps(HYPERPARAMETERS, indent=1))

    def read():
        card = read_task(str(folder / "card.toml"))
        assert to_toml(card.with_settings(["ppo.gamma=0.5"]))
        assert relation(read_task("racer-inner"), card)

    def track():
        assert load_track(str(folder / "mine.npy")).tightest_radius >= 0

    kinds = {
        "card.toml": (read, partial(damage.toml_cases, CARD)),
        "model_metadata.json": (read, damage.json_cases),
        "hyperparameters.json": (read, damage.json_cases),
        "mine.npy": (track, damage.npy_cases),
    }
    return {name: Target(folder / name, *kind) for name, kind in kinds.items()}


def log_targets(folder):
    log = log_of(folder, TASK)
    log.train(1, [trace(3), trace(4, seed=1)])
    steps = folder / "training-simtrace" / "0-iteration.csv"
    text = folder / TEXT_FILE
    episodes = folder / "metrics" / "TrainingMetrics.json"
    return {
        "simtrace": Target(steps, lambda: list(read_training(folder)), damage.csv_cases),
        "steps as text": Target(text, lambda: read_episodes(text), damage.csv_cases),
        "TrainingMetrics.json": Target(episodes, log._holds_training, damage.json_cases),
    }


def all_targets(root):
    makers = (teacher_targets, run_targets, card_targets, log_targets)
    found = {}
    for maker in makers:
        found |= maker(root / maker.__name__)
    return found
