"""The numbers of an experiment: frozen, checked once, a sentence and a unit per field.

A default here is the tested one; a task's card holds only what differs. Names are the field's
standard terms, the paper's symbol is in each sentence.
"""

import ast
import inspect
import textwrap
from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from types import MappingProxyType
from typing import Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
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
    @cache
    def sentences(cls) -> Mapping[str, str]:
        """Return the sentence under each field, read from the source on the first call."""
        bases = [base for base in cls.__bases__ if issubclass(base, Settings)]
        inherited = {name: text for base in bases for name, text in base.sentences().items()}
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
        assert isinstance(body, ast.ClassDef)
        return MappingProxyType(inherited | {
            field.target.id: inspect.cleandoc(str(text.value.value))
            for field, text in pairwise(body.body)
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
        })  # fmt: skip


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
    is_shown = problem["type"] != "missing" and not isinstance(problem["input"], Mapping)
    value = f", found {problem['input']!r:.100}" if is_shown else ""
    wanted = problem["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    return f"{where}: {wanted:.200}{value}".removeprefix(": ")


class PPOConfig(Settings):
    """Clipped PPO with generalised advantage estimation (paper, section 3 and tables 3-5)."""

    n_iterations: int = Field(60, gt=0)
    """Iterations of training: one rollout and one update each."""
    n_steps: int | None = Field(2048, gt=0)
    """Valid environment steps in a rollout; absent when `n_episodes` counts instead."""
    n_episodes: int | None = Field(None, gt=0)
    """Whole episodes in a rollout; when given, n_envs is not used."""
    max_steps: int | None = Field(None, gt=0)
    """About how many steps a rollout's episodes may take, by the mean length of those before: a
    seed then plays fewer than `n_episodes`, but no fewer than five. Absent: always all."""
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
    normalize_rewards: bool = False
    """Whether Â and the critic's targets are of rewards divided by the running deviation of
    discounted returns, as those of Stable-Baselines3's VecNormalize; what is reported is not."""
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
    """β of the objective `trpo`, weight of KL(μ‖π_θ)."""
    kl_penalty: float = Field(0.0, ge=0)
    """Weight of KL(π_old‖π_θ) in L_rep of the other objectives (paper, appendix D: used, with a
    weight that is not published)."""
    kl_over: Literal["max", "mean"] = "max"
    """Whether that KL is the largest over a minibatch's states, as the paper's text has TRPO's, or
    their mean."""
    weight_decay: float = Field(0.0, ge=0)
    """Weight of half the squared L2 norm of the weights, biases and log σ not counted, in the loss:
    so much of a weight is added to its gradient."""
    ent_coef: float = Field(1e-4, ge=0)
    """Weight of the entropy bonus."""
    target_kl: float | None = Field(None, gt=0)
    """A policy takes no further epoch of an update after one whose mean approximate KL(π_old‖π) is
    above this; the critic goes on. Absent: it always takes all."""
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
    joint updates, `weight_decay` and a KL; false runs the formulas as written."""
    stacked: bool = True
    """Whether dense networks that are not `compiled` learn all seeds in one product; false learns
    seed by seed: slower with several, but then each is what it would be alone, bit for bit."""

    @property
    def kl_weight(self) -> float:
        """Weight of a KL in L_rep."""
        return self.kl_coef if self.objective == "trpo" else self.kl_penalty

    @model_validator(mode="after")
    def _one_length(self) -> "PPOConfig":
        if self.n_episodes is None and self.n_steps is None:
            raise ValueError("a rollout needs n_steps or n_episodes")
        if self.max_steps is not None and self.n_episodes is None:
            raise ValueError("max_steps limits n_episodes, and there are none: n_steps is exact")
        return self


class EvalConfig(Settings):
    """Evaluation after every iteration."""

    episodes: int = Field(20, gt=0)
    """Episodes per seed and evaluation."""
    actions: Literal["likeliest", "sampled"] = "likeliest"
    """Whether a policy takes its likeliest actions, or draws them as in training, by which one that
    does not see all that matters may do better. Not of q-learning."""
    noise: Literal["none", "paper"] = "none"
    """Small noise on observations and actions (racer only; paper, appendix B.1)."""
    both_directions: bool = False
    """Whether every other episode drives the track the other way (racer only)."""
    best: Literal["return", "progress", "lap_time"] = "return"
    """By what of its evaluations the best policy of a run is chosen: the mean return, the mean
    progress, or laps, first how many, then how fast (the last two racer only)."""
    laps: int = Field(3, gt=0, le=100)
    """Laps of a race, as `repaint eval --race` evaluates (racer only, as the next four)."""
    off_track_penalty: float = Field(5.0, ge=0)
    """In a race for leaving the road or driving backwards, s."""
    crash_penalty: float = Field(5.0, ge=0)
    """In a race for a crash, s."""
    max_resets: int = Field(100, ge=0)
    """So often a car is put back on the road in a race, which then is over."""
    reset_behind: float = Field(1.0, ge=-10, le=10)
    """How far behind an object that is near a car is put back, m; below 0 it is ahead of it."""
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
