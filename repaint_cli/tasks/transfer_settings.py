"""The numbers of a transfer: what the teacher contributes, and which of its samples count."""

from typing import Literal

from pydantic import Field, NonNegativeFloat

from repaint_cli.settings import Settings


class TransferConfig(Settings):
    """What the teacher contributes, and for how long (paper, algorithms 1 and 2)."""

    iterations: int = Field(15, ge=0)
    """K, the last iteration with a teacher ("Num. REPAINT iterations"); plain PPO afterwards."""
    representation: int = Field(1, ge=1)
    """R of the ratio R:I, on-policy iterations in a row; someone must train the critic."""
    instance: int = Field(1, ge=0)
    """I of the ratio R:I, off-policy instance-transfer iterations in a row; 0 is kickstarting."""
    phases: Literal["ratio", "auto"] = "ratio"
    """Whether R and I say what comes next, or, with auto, an instance iteration after each own one
    while a teacher leads and samples of it were kept."""
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
    """α₁: the learning rate of L_rep's steps is multiplied by it."""
    alpha_2: float = Field(1.0, ge=0)
    """α₂, the same for L_ins; in a joint update each loss has Adam's moments of its own."""
    alpha_power: float = Field(0.0, ge=0, le=1)
    """a of the power law k^−a that both α are multiplied by (paper, section 5.1)."""
    start: Literal["untrained", "teacher", "auto"] = "untrained"
    """What students start from: new weights, or the first teacher's (`--method warm-start` says
    so); auto: the teacher's where it has equal networks and earns more than untrained policies."""
    warm_start: Literal["policy", "policy+value"] = "policy+value"
    """What a start from the teacher takes of it; the normaliser belongs to both."""
    warm_start_log_std: float | None = None
    """log σ to begin a warm start with, in place of the teacher's; continuous actions."""
    warm_start_min_std: float = Field(0.0, ge=0)
    """Floor on the σ that a warm start begins with; continuous actions."""
    distill_epochs: int = Field(0, ge=0)
    """Once, after the first update with β > 0: so many epochs of the cross-entropy to the teacher
    alone, with weight 1, on the student's own samples; the policy moves, with α₁, and no critic."""
    distill_minibatch: int = Field(128, gt=0)
    """Samples per gradient step of these epochs."""
    distill_mirrored: bool = False
    """Whether the mirror images of these samples count as well, with the teacher's advice mirrored;
    for tasks whose reward terms all stay the same in the mirror."""
    importance: bool = True
    """Whether A2C and REINFORCE weigh a teacher's sample by ρ = π_θ/π_teacher (paper, appendix E);
    false: by its advantage alone, which is advantage-weighted cloning of the teacher."""
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
    loss_scale: Literal["selected", "raw", "student"] = "selected"
    """What L_ins learns from: Â′ as it was selected, Â′ raw, or Â′/σ with σ of Â in the student's
    last batch, so that L_ins and L_clip stand on one scale."""
    min_samples: int = Field(0, ge=0)
    """With fewer samples kept, a seed takes no step on them (RL Coach: 64, a minibatch)."""


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
