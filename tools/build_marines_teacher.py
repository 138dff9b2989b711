"""The warm start of the shipped teacher of `build-marines`: a network that imitates a script.

    python tools/build_marines_teacher.py scripted.safetensors

The script is `envs/starcraft/build_order.py`. In each round script and network take turns at
random; what the script would have done at each step is kept, and the network follows the
cross-entropy to that of all rounds (DAgger; Ross et al., 2011). The critic learns nothing here.
"""

import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from repaint_cli import load_task
from repaint_cli.envs.starcraft.build_order import BuildOrder
from repaint_cli.envs.starcraft.engines import engine_of
from repaint_cli.envs.starcraft.env import StarCraftVectorEnv
from repaint_cli.envs.starcraft.simulator import StarCraftSimulator
from repaint_cli.files.provenance import versions
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.spec import UpdateSpec
from repaint_cli.learn.update.update import update
from repaint_cli.policies.compound import HIDDEN, Compound
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo import store
from repaint_cli.zoo.scoring import score
from repaint_cli.zoo.teacher_card import TeacherCard

SEED = 7
SHARES = (1.0, 0.5, 0.0, 0.0, 0.0)
"""How often the script acts, round by round; else the network does."""
EPISODES, EPOCHS = 3, 2
"""Of a round, and how often all samples so far are learned after it."""
LEARNING_RATE, MINIBATCH = 5e-4, 128


def play(
    task: TaskCard, student: ActorCritic, share: float, seed: int, rng: np.random.Generator
) -> Iterator[tuple[dict[str, NDArray[Any]], NDArray[np.int16], float]]:
    """Play an episode; yield what was observed, the script's action (3,), and marines built.

    Args:
        task: of the mini-game.
        student: who acts where the script does not, as it samples.
        share: how often the script acts.
        seed: of the episode.
        rng: decides who acts, and how.
    """
    assert isinstance(task.env, StarCraftSimulator)
    engine = engine_of(task.env, 1)
    env = StarCraftVectorEnv(engine, 1)
    obs, _ = env.reset(seed=seed)
    script = BuildOrder(engine.observe(), width=task.env.spec.camera.width)
    over = False
    while not over:
        action = wanted = script.act(engine.observe())
        observations = {name: array[0].copy() for name, array in obs.items()}
        if rng.random() >= share:
            batch = {name: torch.from_numpy(array)[None] for name, array in obs.items()}
            with torch.no_grad():
                policy = student.policy(batch)
                noise = policy.noise(rng, (1, 1, policy.n_actions))
                action = policy.sample(torch.from_numpy(noise))[0, 0].numpy()
            if action[0] != wanted[0]:
                script.passed_over()
        obs, _, terminated, truncated, infos = env.step(action[None].astype(np.int64))
        over = bool(terminated[0] or truncated[0])
        yield observations, wanted, float(infos["marines_built"][0])


def certain(actions: Tensor, spaces: Spaces) -> Compound:
    """Return the distribution that does these actions (1, B, P) for certain."""
    parts = [
        torch.full((*actions.shape[:2], size), HIDDEN).scatter(-1, actions[..., p : p + 1], 0.0)
        for p, size in enumerate(spaces.sizes)
    ]
    return Compound(
        torch.cat(parts, -1), spaces.sizes, torch.tensor(spaces.uses, dtype=torch.float32)
    )


def samples_of(
    observations: list[dict[str, NDArray[Any]]], wanted: list[NDArray[np.int16]]
) -> Samples:
    """Return steps (B,) as samples of one seed, which the script's actions belong to."""
    n = len(wanted)
    stores = {
        name: torch.from_numpy(np.stack([one[name] for one in observations]))
        for name in observations[0]
    }
    actions, zeros = torch.from_numpy(np.stack(wanted).astype(np.int64))[None], torch.zeros(1, n)
    return Samples(
        counts=torch.tensor([n]), observations=Observations([stores]),
        rows=torch.arange(n)[None], actions=actions, behavior_log_probs=zeros, advantages=zeros,
        returns=zeros, rewards=zeros,
    )  # fmt: skip


def train(task: TaskCard) -> tuple[ActorCritic, int]:
    """Return a network that imitates the script, and how many steps were played."""
    env = task.make_env(1)
    spaces = Spaces.of(env.single_observation_space, env.single_action_space)
    student, rng = (
        ActorCritic(spaces, task.net, 1).in_precision("auto"),
        np.random.default_rng(SEED),
    )
    student.initialize([generator(SEED, Purpose.INITIALIZE)])
    optimizer = RowAdam(student, LEARNING_RATE)
    changed = {"n_epochs": EPOCHS, "minibatch_size": MINIBATCH}
    observations, wanted = list[dict[str, NDArray[Any]]](), list[NDArray[np.int16]]()
    for i, share in enumerate(SHARES):
        marines = 0.0
        for episode in range(EPISODES):
            for obs, action, built in play(task, student, share, 100 * i + episode, rng):
                observations.append(obs)
                wanted.append(action)
                marines += built
        samples = samples_of(observations, wanted)
        spec = UpdateSpec(
            task.ppo.model_copy(update=changed), 0.2, loss="distillation", networks="policy",
            teacher=certain(samples.actions, spaces), beta=1.0,
        )  # fmt: skip
        metrics = update(student, optimizer, samples, spec, [rng])
        print(
            f"round {i + 1}: the script acts {share:.0%}: {marines / EPISODES:.1f} marines; "
            f"cross-entropy {metrics['cross_entropy'][0]:.3f}",
            flush=True,
        )
    return student, len(wanted)


def main(path: Path) -> None:
    """Train, measure and write the teacher."""
    task = load_task("build-marines")
    student, steps = train(task)
    student, spaces = student.in_precision("float32"), student.spaces
    card = TeacherCard(
        name=path.stem, task=task, obs_shape=spaces.obs_shape, n_actions=spaces.n_actions,
        discrete=True, parts=dict(spaces.parts), sizes=spaces.sizes, uses=spaces.uses,
        algorithm="imitation of a script", method="scratch", seed=SEED, iteration=len(SHARES),
        env_steps=steps, score=score(student, task, SEED), versions=versions(),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )  # fmt: skip
    print(card.score)
    print(store.add(student, 0, card, path.parent))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
