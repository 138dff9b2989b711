"""Train the shipped teacher of `build-marines`: a network that imitates a script.

    python tools/build_marines_teacher.py build-marines.safetensors

The script is `envs/starcraft/build_order.py`. In each round script and network take turns at
random; what the script would have done at each step is kept, and the network follows the
cross-entropy to that of the last rounds (DAgger; Ross et al., 2011). The critic learns nothing.
"""

import sys
from collections import deque
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
from repaint_cli.envs.starcraft.rts.constants import SELECT_POINT
from repaint_cli.envs.starcraft.rts.engine import Observation
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
SCVS, HALLS = 32, 4
"""What the script builds, where SCVs of the minerals build and then stay: 103 marines. A network
rarely hits the one SCV on the way that is nearest to a site, which costs the script less."""
SHARES = (1.0, 0.5, 0.2, 0.1, 0.05, 0.05, 0.02, 0.02) + (0.0,) * 8
"""How often the script acts, round by round; else the network does."""
GAMES = 4
"""Of a round, side by side."""
KEPT = 4
"""Rounds whose samples are learned, once after each of them; one takes 1.2 GB of memory."""
TIMES = 4
"""How often a step counts that builds or trains; most steps select something, or wait."""
LEARNING_RATE, MINIBATCH = 5e-4, 128
"""The rate of the first round, from where it falls to 0."""

Steps = list[tuple[dict[str, NDArray[Any]], NDArray[np.int16]]]
"""What was observed, by name, and what the script would have done, (GAMES, 3)."""


def play(
    task: TaskCard, student: ActorCritic, share: float, seed: int, rng: np.random.Generator
) -> tuple[Steps, float]:
    """Play games side by side to their end; return their steps, and the marines of a game.

    Args:
        task: of the mini-game.
        student: who acts where the script does not, as it samples.
        share: how often the script acts.
        seed: of the games.
        rng: decides who acts, and how.
    """
    assert isinstance(task.env, StarCraftSimulator)
    engine = engine_of(task.env, GAMES)
    env = StarCraftVectorEnv(engine, GAMES)
    obs, _ = env.reset(seed=seed)
    width, steps, over, marines = task.env.spec.camera.width, Steps(), False, 0.0
    scripts = [
        BuildOrder(game, SCVS, HALLS, width, by_miners=True) for game in games_of(engine.observe())
    ]
    while not over:
        games = zip(scripts, games_of(engine.observe()), strict=True)
        wanted = np.stack([script.act(game) for script, game in games])
        steps.append(({name: array.copy() for name, array in obs.items()}, wanted))
        actions = sampled(student, obs, rng)
        scripted = rng.random(GAMES) < share
        actions[scripted] = wanted[scripted]
        for script, action, own in zip(scripts, actions, wanted, strict=True):
            if action[0] != own[0]:
                script.passed_over()
        obs, _, terminated, truncated, infos = env.step(actions)
        over = bool((terminated | truncated).all())
        marines += infos["marines_built"].mean()
    return steps, float(marines)


def games_of(observation: Observation) -> Iterator[Observation]:
    """Yield each game's observation by itself."""
    for k in range(GAMES):
        own = slice(k, k + 1)
        yield Observation(
            observation.screen[own], observation.minimap[own], observation.measurements[own],
            observation.available[own],
        )  # fmt: skip


def sampled(
    student: ActorCritic, obs: dict[str, NDArray[Any]], rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return actions (GAMES, 3) as the network draws them."""
    batch = {name: torch.from_numpy(array)[None] for name, array in obs.items()}
    with torch.no_grad():
        policy = student.policy(batch)
        noise = policy.noise(rng, (1, GAMES, policy.n_actions))
        return policy.sample(torch.from_numpy(noise))[0].numpy().astype(np.int64)


def certain(actions: Tensor, spaces: Spaces) -> Compound:
    """Return the distribution that does these actions (1, B, P) for certain."""
    parts = [
        torch.full((*actions.shape[:2], size), HIDDEN).scatter(-1, actions[..., p : p + 1], 0.0)
        for p, size in enumerate(spaces.sizes)
    ]
    return Compound(
        torch.cat(parts, -1), spaces.sizes, torch.tensor(spaces.uses, dtype=torch.float32)
    )


def samples_of(steps: Steps) -> Samples:
    """Return steps as samples of one seed, which the script's actions belong to."""
    stores = {
        name: torch.from_numpy(np.concatenate([obs[name] for obs, _ in steps]))
        for name in steps[0][0]
    }
    wanted = torch.from_numpy(np.concatenate([wanted for _, wanted in steps]).astype(np.int64))
    rare = (wanted[:, 0] != SELECT_POINT).nonzero().flatten()
    rows = torch.cat([torch.arange(len(wanted)), rare.repeat(TIMES - 1)])
    zeros = torch.zeros(1, len(rows))
    return Samples(
        counts=torch.tensor([len(rows)]), observations=Observations([stores]), rows=rows[None],
        actions=wanted[rows][None], behavior_log_probs=zeros, advantages=zeros, returns=zeros,
        rewards=zeros,
    )  # fmt: skip


def train(task: TaskCard) -> tuple[ActorCritic, int]:
    """Return a network that imitates the script, and how many steps were played."""
    env = task.make_env(1)
    spaces = Spaces.of(env.single_observation_space, env.single_action_space)
    rng, student = np.random.default_rng(SEED), ActorCritic(spaces, task.net, 1)
    student = student.in_precision("auto")
    student.initialize([generator(SEED, Purpose.INITIALIZE)])
    optimizer = RowAdam(student, LEARNING_RATE)
    ppo = task.ppo.model_copy(update={"n_epochs": 1, "minibatch_size": MINIBATCH})
    rounds, n_steps = deque[Steps](maxlen=KEPT), 0
    for i, share in enumerate(SHARES):
        steps, marines = play(task, student, share, 1000 + GAMES * i, rng)
        rounds.append(steps)
        n_steps += GAMES * len(steps)
        optimizer.learning_rate = LEARNING_RATE * (1 - i / len(SHARES))
        samples = samples_of([step for one in rounds for step in one])
        spec = UpdateSpec(
            ppo, ppo.clip_range, loss="distillation", networks="policy",
            teacher=certain(samples.actions, spaces), beta=1.0,
        )  # fmt: skip
        metrics = update(student, optimizer, samples, spec, [rng])
        print(
            f"round {i + 1}: the script acts {share:.0%}: {marines:.1f} marines a game; "
            f"cross-entropy {metrics['cross_entropy'][0]:.3f}",
            flush=True,
        )
    return student, n_steps


def main(path: Path) -> None:
    """Train, measure and write the teacher."""
    task = load_task("build-marines")
    student, steps = train(task)
    student, spaces = student.in_precision("float32"), student.spaces
    card = TeacherCard(
        name=path.stem, task=task, obs_shape=spaces.obs_shape, n_actions=spaces.n_actions,
        discrete=True, parts=dict(spaces.parts), sizes=spaces.sizes, uses=spaces.uses,
        algorithm="DAgger", method="from a script", seed=SEED, iteration=len(SHARES),
        env_steps=steps, score=score(student, task, SEED), versions=versions(),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )  # fmt: skip
    print(card.score)
    print(store.add(student, 0, card, path.parent))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
