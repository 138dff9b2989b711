"""The students that learn, and how they and their teachers act."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from repaint_cli.activity import doing
from repaint_cli.envs.reward_functions import Functions
from repaint_cli.learn.rollout.batches import even_share
from repaint_cli.learn.rollout.collect import Policy, collect, start
from repaint_cli.learn.rollout.reward_scale import RewardScale
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.stream import Stream
from repaint_cli.learn.rollout.transitions import Experience
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.policies.devices import HOST, make_deterministic
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.settings import PPOConfig
from repaint_cli.tasks.card import TaskCard

MIN_EPISODES = 5
"""Episodes of a rollout that `ppo.max_steps` leaves, at least."""


@dataclass
class Learner:
    """All that changes of S students while they learn; a checkpoint holds it."""

    student: ActorCritic
    """The policies and critics."""
    optimizer: RowAdam
    """Their optimiser."""
    seeds: list[int]
    """The run seeds, (S,)."""
    iteration: int
    """Finished iterations."""
    env_steps: np.ndarray
    """Steps taken for training, the teacher's among them, (S,)."""
    episode_lengths: np.ndarray
    """Mean length of the episodes of the students' last rollout, steps, (S,), where it decides how
    many they play; 0 before the first."""
    memory: Experience | None = None
    """The replay buffer of Q-learning: each seed's newest transitions."""
    reward_scale: RewardScale | None = None
    """What rewards are divided by before learning, where they are."""
    streams: dict[str, Stream] = field(default_factory=dict)
    """The environments that rollouts go on with, by who acts in them, where episodes continue."""
    functions: dict[tuple[Purpose, int, int], Functions] = field(default_factory=dict)
    """A user's reward function for each copy of the environment, whose variables last as long as
    the training does; no checkpoint holds them."""

    @classmethod
    def fresh(
        cls, student: ActorCritic, seeds: list[int], learning_rate: float, *, joint: bool = False
    ) -> "Learner":
        """Start with newly drawn parameters; `joint` says whether updates are algorithm 1's."""
        n = len(seeds)
        make_deterministic(student.device.type)
        student.initialize([generator(seed, Purpose.INITIALIZE) for seed in seeds])
        optimizer = RowAdam(student, learning_rate, joint=joint)
        return cls(student, optimizer, seeds, 0, np.zeros(n, int), np.zeros(n))

    def collect(
        self, card: TaskCard, k: int, policy: Policy | None = None, *, n_teachers: int = 0
    ) -> Rollout:
        """Let the students act, as many steps or episodes as the card says.

        Args:
            card: the target task.
            k: the iteration.
            policy: how they act; by their policies where absent.
            n_teachers: how many teachers act in the same iteration and share its steps.
        """
        ppo = card.ppo
        with doing("collecting"):
            rollout = self._roll(
                card, k, policy or self.student.policy, (Purpose.TRAIN, Purpose.ACT),
                n_steps=None if ppo.n_episodes else even_share(ppo.n_steps or 0, 0, 1 + n_teachers),
                n_envs=ppo.n_episodes or max(1, ppo.n_envs // (1 + n_teachers)),
                playing=self._playing(ppo, k), record=card.env.records,
            )  # fmt: skip
        if ppo.max_steps is not None:
            self.episode_lengths = rollout.mean_episodes()[1]
        if ppo.normalize_rewards:
            self.reward_scale = self.reward_scale or RewardScale(len(self.seeds))
            self.reward_scale.update(rollout, ppo.gamma, continues=card.continues_episodes)
        return self._scaled(rollout)

    def _scaled(self, rollout: Rollout) -> Rollout:
        """Return a rollout with the rewards that students learn from."""
        return self.reward_scale.applied(rollout) if self.reward_scale else rollout

    def _playing(self, ppo: PPOConfig, k: int) -> np.ndarray | None:
        """Return which of a rollout's episodes each student plays, (S, N), evenly spread."""
        if ppo.n_episodes is None or ppo.max_steps is None:
            return None
        most, playing = ppo.n_episodes, np.zeros((len(self.seeds), ppo.n_episodes), bool)
        for own, length in zip(playing, self.episode_lengths, strict=True):
            n = most
            if length:
                n = min(most, max(MIN_EPISODES, int(ppo.max_steps / length)))
            own[(np.arange(n) * most // n + k) % most] = True
        return playing

    def collect_teacher(
        self,
        card: TaskCard,
        k: int,
        policy: Policy,
        *,
        which: int = 0,
        of: int = 1,
        student_acts: bool = False,
    ) -> Rollout:
        """Let a teacher act, one of several that share an iteration's steps or episodes.

        Args:
            card: the target task.
            k: the iteration.
            policy: the teacher's.
            which: its number, from 0.
            of: how many teachers there are.
            student_acts: whether the student acts in the same iteration, and shares its steps.
        """
        ppo, sharing = card.ppo, of + student_acts
        if ppo.n_episodes:
            n_steps, n_envs = None, even_share(card.transfer.teacher_episodes, which, of)
        else:
            n_steps = even_share(ppo.n_steps or 0, which + student_acts, sharing)
            n_envs = max(1, ppo.n_envs // sharing)
        with doing("a teacher acts"):
            rollout = self._roll(
                card, k, policy, (Purpose.TEACHER, Purpose.ACT_AS_TEACHER), stream=which,
                n_steps=n_steps, n_envs=n_envs,
            )  # fmt: skip
        return self._scaled(rollout)

    def _roll(
        self,
        card: TaskCard,
        k: int,
        policy: Policy,
        purposes: tuple[Purpose, Purpose],
        *,
        n_steps: int | None,
        n_envs: int,
        playing: np.ndarray | None = None,
        stream: int = 0,
        record: Sequence[str] = (),
    ) -> Rollout:
        """Roll a policy out; `purposes` name the environments' seeds and the noise.

        Of whole episodes each seed plays those of `playing`, (S, N), or all.
        The environments are fresh, or where the card continues episodes those of the last time.
        """
        rngs = [generator(seed, purposes[1], k, stream) for seed in self.seeds]
        where, on_gpu = (card, self.seeds, n_envs, purposes[0], k), self.student.device != HOST
        if n_steps is not None and card.continues_episodes:
            name = f"{purposes[0].name.lower()}-{stream}"
            own = self.streams.get(name)
            if own is None or own.ended.shape != (len(self.seeds), n_envs):
                own = self.streams[name] = Stream.begin(*where, stream, on_gpu=on_gpu)
            rollout = own.collect(policy, rngs, max(1, n_steps // n_envs), record)
        else:
            functions = self.functions_of(purposes[0], n_envs, stream)
            env, obs = start(
                *where, stream=stream, one_episode=n_steps is None, functions=functions,
                playing=playing, on_gpu=on_gpu,
            )  # fmt: skip
            rollout = collect(
                env, obs, policy, rngs, n_steps=n_steps, playing=playing,
                whole=card.ppo.whole_episodes, record=record,
            )  # fmt: skip
            env.close()
        self.env_steps += rollout.valid.sum((0, 2))
        return rollout

    def functions_of(self, purpose: Purpose, n_envs: int, stream: int = 0) -> Functions:
        """Return the user's reward functions of S × N copies of the environment.

        Args:
            purpose: what the copies are for.
            n_envs: N.
            stream: which of several actors.
        """
        return self.functions.setdefault((purpose, n_envs, stream), [])

    def remembered(self) -> list[str]:
        """Return the variables in which the user's reward functions keep something, by name."""
        some_of_each = [one for functions in self.functions.values() for one in functions[:2]]
        return sorted({name for function in some_of_each for name in function.remembers()})

    def bring_streams_back(self, card: TaskCard) -> list[str]:
        """Bring the environments of a checkpoint's streams back to where they were.

        Returns:
            What is to be said where that cannot be; those episodes begin afresh.
        """
        if not card.continues_episodes or not self.iteration:
            return []
        back = {name: own for name, own in self.streams.items() if own.bring_back(card)}
        kept, self.streams = self.streams, back
        if kept and len(back) == len(kept):
            return []
        why = "did not come back to where it was" if kept else "cannot be set back into an episode"
        return [
            f"the environment {card.env.place} {why}, so its episodes begin afresh: from here on "
            "this is another run than one without a stop"
        ]

    def close(self) -> None:
        """Close the environments that rollouts would have gone on with."""
        for own in self.streams.values():
            if own.env:
                own.env.close()
        self.streams = {}

    def shuffles(self, k: int) -> list[np.random.Generator]:
        """Return each seed's generator for the order of its samples in iteration k."""
        return [generator(seed, Purpose.SHUFFLE, k) for seed in self.seeds]

    def update_normalizer(self, rollout: Rollout) -> None:
        """Add a rollout's observations to the statistics of each student's normaliser."""
        if self.student.normalizer:
            for seed, store in enumerate(rollout.observations.stores):
                self.student.normalizer.update(seed, store)
