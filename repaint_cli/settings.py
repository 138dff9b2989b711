"""The numbers of an experiment: frozen, checked once, a sentence and a unit per field.

A default here is the tested one; a task's card holds only what differs. Names are the field's
standard terms, the paper's symbol is in each sentence.
"""

import ast
import inspect
import textwrap
from itertools import pairwise
from typing import Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    ValidationError,
    model_validator,
)

MOST_SEEDS = 1000
"""Run seeds that train side by side, at most."""

UNKNOWN_KEY = "unknown key '"
"""How `first_problem` begins where a key is unknown."""


class Settings(BaseModel):
    """A frozen record that refuses unknown keys and numbers that are not finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    @classmethod
    def sentences(cls) -> dict[str, str]:
        """Return the sentence under each field, read from the source on each call."""
        bases = [base for base in cls.__bases__ if issubclass(base, Settings)]
        inherited = {name: text for base in bases for name, text in base.sentences().items()}
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
        assert isinstance(body, ast.ClassDef)
        return inherited | {
            field.target.id: inspect.cleandoc(str(text.value.value))
            for field, text in pairwise(body.body)
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
        }  # fmt: skip


def first_problem(error: ValidationError) -> str:
    """Return the first thing that is wrong with a record: the key, what was wanted and found."""
    if error.error_count() > 1000:  # whose texts take a kilobyte each
        return f"{error.error_count():,} of its values are not what they should be"
    problems = error.errors()
    same = [problem for problem in problems if problem["loc"][:2] == problems[0]["loc"][:2]]
    problem = max(same, key=lambda problem: len(problem["loc"]))  # of several kinds, the nearest
    kinds = ("[", "constrained-")  # of a value that may be of several, which pydantic names too
    loc = [str(part) for part in problem["loc"] if not any(kind in str(part) for kind in kinds)]
    where = f"{'.'.join(loc):.200}"
    if problem["type"] == "extra_forbidden":
        return f"{UNKNOWN_KEY}{where}'"
    value = "" if problem["type"] == "missing" else f", found {problem['input']!r:.100}"
    wanted = problem["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    return f"{where}: {wanted:.200}{value}"


class PPOConfig(Settings):
    """Clipped PPO with generalised advantage estimation (paper, section 3 and tables 3-5)."""

    n_iterations: int = Field(60, gt=0)
    """Iterations of training: one rollout and one update each."""
    n_steps: int | None = Field(2048, gt=0)
    """Valid environment steps in a rollout; absent when `n_episodes` counts instead."""
    n_episodes: int | None = Field(None, gt=0)
    """Whole episodes in a rollout; when given, n_envs is not used."""
    n_envs: int = Field(40, gt=0)
    """Environments per seed that share the `n_steps` of a rollout."""
    n_epochs: int = Field(10, gt=0)
    """Passes over the samples of an iteration."""
    minibatch_size: int = Field(64, gt=0)
    """Samples per gradient step; the remainder of a pass is a smaller step."""
    learning_rate: float = Field(3e-4, gt=0)
    """Adam's step size."""
    learning_rate_decay: int | None = Field(None, gt=0)
    """Iterations over which the step size falls in a straight line to 0; constant where absent."""
    max_grad_norm: float | None = Field(None, gt=0)
    """Longest gradient of a policy, and of a critic, L2 norm; longer ones are scaled down to it.
    Absent: none are. Stable-Baselines3 and CleanRL scale both networks by their common norm."""
    gamma: float = Field(0.99, gt=0, le=1)
    """γ, the discount per step."""
    gae_lambda: float = Field(0.95, ge=0, le=1)
    """λ of the generalised advantage estimates."""
    objective: Literal["clipped", "a2c", "trpo", "reinforce"] = "clipped"
    """The first term of L_rep, and the loss on instances (paper, appendix A): PPO's, that of
    advantage actor-critic, TRPO's with a penalty, or REINFORCE's, whose relatedness is R̂ − V."""
    clip_range: float = Field(0.2, gt=0, lt=1)
    """ε, how far the likelihood ratio may leave 1."""
    clip_decay: int | None = Field(None, gt=0)
    """Iterations over which ε falls in a straight line to 0; constant where absent."""
    kl_coef: float = Field(1.0, ge=0)
    """β of the objective `trpo`, weight of KL(μ‖π)."""
    ent_coef: float = Field(1e-4, ge=0)
    """Weight of the entropy bonus."""
    vf_coef: float = Field(0.5, gt=0)
    """Weight of the value loss."""
    time_limit: Literal["bootstrap", "terminal"] = "bootstrap"
    """Whether V(s′) counts where a time limit cut an episode, or nothing does."""
    whole_episodes: bool = False
    """Whether episodes that run when `n_steps` are full are played out, and the rest cut off after
    advantages are known."""
    continue_episodes: bool | None = None
    """Whether a rollout goes on where the last one ended, within episodes, as those of
    Stable-Baselines3 do; absent: where `n_steps` / `n_envs` is shorter than the longest episode."""
    advantages: Literal["before", "after"] = "before"
    """Whether Â is estimated before the critic's fit, or after it, as algorithms 1 and 2 write."""
    compiled: bool = True
    """Whether an `mlp` with the objective `clipped` is updated with derivatives by hand, but for
    joint updates; false runs the formulas as written."""
    stacked: bool = True
    """Whether dense networks that are not `compiled` learn all seeds in one product; false learns
    seed by seed: slower with several, but then each is what it would be alone, bit for bit."""

    @model_validator(mode="after")
    def _one_length(self) -> "PPOConfig":
        if self.n_episodes is None and self.n_steps is None:
            raise ValueError("a rollout needs n_steps or n_episodes")
        return self


class TransferConfig(Settings):
    """What the teacher contributes, and for how long (paper, algorithms 1 and 2)."""

    iterations: int = Field(15, ge=0)
    """K, the last iteration with a teacher ("Num. REPAINT iterations"); plain PPO afterwards."""
    representation: int = Field(1, ge=1)
    """R of the ratio R:I, on-policy iterations in a row; someone must train the critic."""
    instance: int = Field(1, ge=0)
    """I of the ratio R:I, off-policy instance-transfer iterations in a row; 0 is kickstarting."""
    phases: Literal["ratio", "auto"] = "ratio"
    """Whether R and I say what comes next, or what the last rounds gained per step."""
    joint: bool = False
    """Whether both gradients meet in one update (algorithm 1); `--method repaint-joint` says so."""
    kickstart_coef: NonNegativeFloat | tuple[NonNegativeFloat, ...] = 0.2
    """β₀, weight of the cross-entropy to the teacher at the first iteration; several teachers share
    it evenly, or have a β₀ each."""
    kickstart_decay: float = Field(0.95, gt=0, le=1)
    """β is multiplied by this after each iteration of either kind."""
    kickstart_schedule: Literal["geometric", "linear", "constant", "stepwise", "auto"] = "geometric"
    """How β falls: by `kickstart_decay` each time, in a straight line to 0 after K, not at all, by
    `kickstart_decay` every `kickstart_every` times, or with the teacher's lead over the student."""
    kickstart_every: int = Field(5, gt=0)
    """How many times β stays the same in the schedule `stepwise`."""
    kickstart_counts: Literal["iterations", "representation"] = "iterations"
    """Whether β falls after every iteration, or only after those of representation transfer."""
    alpha_1: float = Field(1.0, gt=0)
    """α₁, scale of L_rep's step: of the learning rate when alternating, of the loss when joint."""
    alpha_2: float = Field(1.0, gt=0)
    """α₂, the same for L_ins."""
    alpha_power: float = Field(0.0, ge=0, le=1)
    """a of the power law k^−a that both α are multiplied by (paper, section 5.1)."""
    warm_start: Literal["policy", "policy+value"] = "policy+value"
    """What `--method warm-start` takes from the teacher; the normaliser belongs to both."""
    warm_start_log_std: float | None = None
    """log σ to begin a warm start with, in place of the teacher's; continuous actions."""
    critic_warmup: int = Field(0, ge=0)
    """First iterations, with the student's own rollouts, in which only the critic learns."""
    teacher_min_std: float = Field(0.0, ge=0)
    """Floor on the teacher's σ when it samples, is scored and is imitated; continuous actions."""
    teacher_temperature: float = Field(1.0, gt=0)
    """Temperature of the teacher's softmax for the same three uses; discrete actions."""
    teacher_episodes: int = Field(2, gt=0)
    """Whole episodes of all teachers in an instance iteration, where rollouts count episodes."""
    teacher_statistics: bool = False
    """Whether what teachers saw enters the student's normaliser of observations, too."""

    def betas(self, n_teachers: int) -> tuple[float, ...]:
        """Return β₀ of each teacher."""
        if isinstance(self.kickstart_coef, tuple):
            return self.kickstart_coef
        return (self.kickstart_coef / n_teachers,) * n_teachers


class SelectConfig(Settings):
    """Which teacher samples survive experience selection (paper, section 4.2)."""

    rule: Literal["zeta", "abs", "top", "per", "rbt", "all", "auto"] = "zeta"
    """Keep Â′ ≥ ζ (the paper's), |Â′| ≥ ζ, the highest share, or all; or draw by |Â′| (prioritised
    replay) or by relevance to the student's last batch (Lazaric et al. 2008); or keep the more, the
    more the teachers' samples surpass the student's."""
    threshold: float = 0.8
    """ζ: a teacher sample is kept where its advantage Â′ ≥ ζ."""
    last_threshold: float | None = None
    """ζ at iteration K, which it moves to in a straight line; constant where absent."""
    share: float = Field(0.2, gt=0, le=1)
    """q: the share of the samples that `top` keeps, and that `per` and `rbt` draw."""
    priority_exponent: float = Field(0.6, ge=0)
    """α of `per`: 0 draws all alike."""
    importance_exponent: float = Field(0.4, ge=0, le=1)
    """β of `per`: 1 makes up for all of the drawing, 0 for none of it."""
    bandwidth: float = Field(0.1, gt=0)
    """δ of `rbt`, the kernels' width in squared standard deviations of the student's batch."""
    neighbourhood: float = Field(0.8, gt=0, le=1)
    """μ of `rbt`: distances are averaged over target samples of this cumulative weight."""
    neighbours: Literal["nearest", "farthest"] = "nearest"
    """Which of them `rbt` counts first; the authors' later code counts from the farthest."""
    normalize: Literal["sum", "max"] = "sum"
    """What `rbt` divides agreement by; by the sum, as written, distance decides nearly alone."""
    scale: Literal["teacher-batch", "student-batch", "none"] = "teacher-batch"
    """What Â′ is standardised with: its own batch, the student's last batch, or nothing (raw)."""


class QLearningConfig(Settings):
    """Q-learning with instance transfer (paper, appendix A): `--algorithm q-learning`."""

    threshold: float = Field(0.0, ge=0)
    """ζ: a teacher's sample is learned from where y − Q > ζ, in the iterations with a teacher."""
    memory: int = Field(20_000, gt=0)
    """Transitions a seed keeps; the oldest iterations go first."""
    gradient_steps: int = Field(1000, gt=0)
    """Minibatches an iteration, drawn from all that is kept; the network behind their targets is
    that of the iteration's beginning."""
    first_epsilon: float = Field(1.0, ge=0, le=1)
    """ε of the first iteration: how often the student acts at random."""
    last_epsilon: float = Field(0.05, ge=0, le=1)
    """ε that it falls to in a straight line."""
    epsilon_iterations: int = Field(10, gt=0)
    """Iterations after which it is there."""


class EvalConfig(Settings):
    """Evaluation after every iteration, with the deterministic policy."""

    episodes: int = Field(20, gt=0)
    """Episodes per seed and evaluation."""
    noise: Literal["none", "paper"] = "none"
    """Small noise on observations and actions (racer only; paper, appendix B.1)."""
    both_directions: bool = False
    """Whether every other episode drives the track the other way (racer only)."""
    action_noise: float = Field(0.1, ge=0, le=1)
    """Steering and speed are each multiplied by 1 + U(−a, a), where there is noise."""
    brightness_noise: float = Field(0.1, ge=0, le=1)
    """An image is multiplied by 1 + U(−b, b)."""
    pixel_noise: float = Field(2.0, ge=0, le=99)
    """Standard deviation added to each pixel, grey levels."""
    salt_pepper: float = Field(0.001, ge=0, le=1)
    """Fraction of pixels that turn black or white."""
    shift: int = Field(1, ge=0, le=99)
    """An image moves by up to so many pixels along each axis."""
