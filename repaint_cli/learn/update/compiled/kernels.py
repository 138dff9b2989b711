"""Small dense networks, their derivatives and Adam, compiled: one policy or one critic at a time.

The derivatives are those of `losses` and `distributions`, by hand. The records stand here, for
numba's cache knows when this file changes and no other. Shapes: n samples of a seed, b of them in a
minibatch, O observation, A actions, P parameters of a tower, which is a policy or a critic.
"""

from math import exp, expm1, log, pi, sqrt
from typing import NamedTuple

import numpy as np

from repaint_cli.kernels import loose_kernel

POLICY_NUMBERS = (
    "policy_loss", "entropy", "cross_entropy", "approx_kl", "clip_fraction", "log_ratio"
)  # fmt: skip
"""What `learn_policy` tells of each of its steps, in this order."""


class Tower(NamedTuple):
    """A policy or a critic of one seed: views into the flat buffers, and room for a minibatch."""

    weights: tuple[np.ndarray, ...]
    """(in, out) of each layer, the head last."""
    weight_gradients: tuple[np.ndarray, ...]
    """(in, out) each."""
    biases: tuple[np.ndarray, ...]
    """(out,) each."""
    bias_gradients: tuple[np.ndarray, ...]
    """(out,) each."""
    outputs: tuple[np.ndarray, ...]
    """Room for what each layer puts out, (b, out) each."""
    slopes: tuple[np.ndarray, ...]
    """Room for ∂L/∂(x·W + b) of each layer, (b, out) each."""


class Row(NamedTuple):
    """The same tower as Adam sees it, flat."""

    parameters: np.ndarray
    """θ, (P,)."""
    gradients: np.ndarray
    """∂L/∂θ, (P,)."""
    first: np.ndarray
    """Adam's first moments, (P,)."""
    second: np.ndarray
    """Adam's second moments, (P,)."""
    steps: int
    """Steps taken before."""
    learning_rate: float
    """Adam's step size."""
    epsilon: float
    """Adam's ε."""


class Batch(NamedTuple):
    """What one seed learns from, (n, …) each."""

    obs: np.ndarray
    """Normalised observations, (n, O)."""
    order: np.ndarray
    """The order of the samples in every epoch, (epochs, n)."""
    size: int
    """Samples per minibatch; the remainder of an epoch is a smaller one."""


class Choices(NamedTuple):
    """What was done at each sample, and what the teacher would do."""

    discrete: bool
    """Whether the policy is categorical; otherwise it is Gaussian."""
    actions: np.ndarray
    """a, (n, A); a one-hot row where discrete."""
    behavior_log_probs: np.ndarray
    """log μ(a|s), (n,)."""
    advantages: np.ndarray
    """Â, (n,)."""
    teacher: np.ndarray
    """The teacher's mean, or log-probabilities, (n, A)."""
    teacher_log_std: np.ndarray
    """log τ of a Gaussian teacher, (n, A)."""
    clip_range: float
    """ε of the clipped surrogate."""
    ent_coef: float
    """Weight of the entropy bonus."""
    beta: float
    """β_k, weight of the cross-entropy."""


@loose_kernel
def tanh(x: np.float32) -> np.float32:
    """Return the hyperbolic tangent to 3·10⁻⁷, in arithmetic that becomes vector instructions.

    Lambert's continued fraction at y = x/4, then twice tanh 2y = 2t/(1 + t²).
    """
    x = np.float32(9) if x > np.float32(9) else x  # a nan stays one
    x = np.float32(-9) if x < np.float32(-9) else x
    y = x * np.float32(0.25)
    s = y * y
    over = np.float32(135135) + s * (np.float32(17325) + s * (np.float32(378) + s))
    under = np.float32(135135) + s * (
        np.float32(62370) + s * (np.float32(3150) + s * np.float32(28))
    )
    t = y * over / under
    t = np.float32(2) * t / (np.float32(1) + t * t)
    return np.float32(2) * t / (np.float32(1) + t * t)


@loose_kernel
def forward(x: np.ndarray, tower: Tower) -> None:
    """Fill the outputs of each layer, tanh(x·W + b), the head's without tanh; x is (b, O)."""
    head = len(tower.weights) - 1
    for layer in range(head + 1):
        out, bias = tower.outputs[layer][: len(x)], tower.biases[layer]
        np.dot(x, tower.weights[layer], out)
        for i in range(len(x)):
            if layer == head:
                for j in range(len(bias)):
                    out[i, j] += bias[j]
            else:
                for j in range(len(bias)):
                    out[i, j] = tanh(out[i, j] + bias[j])
        x = out


@loose_kernel
def backward(x: np.ndarray, tower: Tower) -> None:
    """Fill the gradients from the head's slopes ∂L/∂out; x is (b, O), as `forward` saw it."""
    for layer in range(len(tower.weights) - 1, -1, -1):
        slope = tower.slopes[layer][: len(x)]
        below = tower.outputs[layer - 1][: len(x)] if layer else x
        np.dot(below.T, slope, tower.weight_gradients[layer])
        bias_gradient = tower.bias_gradients[layer]
        bias_gradient[:] = 0
        for i in range(len(x)):
            for j in range(len(bias_gradient)):
                bias_gradient[j] += slope[i, j]
        if layer:
            under = tower.slopes[layer - 1][: len(x)]
            np.dot(slope, tower.weights[layer].T, under)
            for i in range(len(x)):  # tanh′ = 1 − tanh²
                for j in range(under.shape[1]):
                    under[i, j] *= np.float32(1) - below[i, j] * below[i, j]


@loose_kernel
def adam(row: Row, step: int) -> None:
    """Take Adam's step number `step` (Kingma & Ba 2015, algorithm 1), β₁ = 0.9, β₂ = 0.999."""
    rate = np.float32(row.learning_rate / (1 - 0.9**step))
    scale = np.float32(1 / sqrt(1 - 0.999**step))
    epsilon = np.float32(row.epsilon)
    for i in range(len(row.parameters)):
        g = row.gradients[i]
        row.first[i] += np.float32(1 - 0.9) * (g - row.first[i])
        row.second[i] = np.float32(0.999) * row.second[i] + np.float32(1 - 0.999) * g * g
        spread = np.sqrt(row.second[i]) * scale + epsilon
        row.parameters[i] -= rate * row.first[i] / spread


@loose_kernel
def surrogate(log_ratio: float, advantage: float, clip_range: float, told: np.ndarray) -> float:
    """Return ∂/∂log π of −min(ρA, clip(ρ)·A) at a sample, and add what it tells to `told`."""
    ratio = exp(log_ratio)
    clipped = min(max(ratio, 1 - clip_range), 1 + clip_range) * advantage
    told[0] -= min(ratio * advantage, clipped)
    told[3] += expm1(log_ratio) - log_ratio
    told[4] += abs(ratio - 1) > clip_range
    told[5] += log_ratio
    return -ratio * advantage if ratio * advantage <= clipped else 0.0


@loose_kernel
def gaussian_head(
    means: np.ndarray,
    log_std: np.ndarray,
    rows: np.ndarray,
    choices: Choices,
    slopes: np.ndarray,
    log_std_gradient: np.ndarray,
    told: np.ndarray,
) -> None:
    """Fill ∂L/∂μ (b, A) and ∂L/∂log σ (A,) of −L_clip − c·H(π) + β·H(T‖π), means over a minibatch.

    ∂log π/∂μ = z/σ            ∂log π/∂log σ = z² − 1          z = (a − μ)/σ
    ∂H(T‖π)/∂μ = (μ − m)/σ²    ∂H(T‖π)/∂log σ = 1 − (τ² + (m − μ)²)/σ²
    """
    n, half_log_2pi = len(rows), 0.5 * log(2 * pi)
    inverse = np.exp(-log_std)  # 1/σ
    log_std_gradient[:] = -choices.ent_coef
    told[1] += n * (log_std + half_log_2pi + 0.5).sum()
    for i in range(n):
        row, log_prob = rows[i], 0.0
        for d in range(len(log_std)):
            z = (choices.actions[row, d] - means[i, d]) * inverse[d]
            log_prob -= 0.5 * z * z + log_std[d] + half_log_2pi
        pull = surrogate(
            log_prob - choices.behavior_log_probs[row], choices.advantages[row],
            choices.clip_range, told,
        )  # fmt: skip
        for d in range(len(log_std)):
            z = (choices.actions[row, d] - means[i, d]) * inverse[d]
            gap = means[i, d] - choices.teacher[row, d]
            noise = exp(2 * choices.teacher_log_std[row, d])  # τ²
            spread = (noise + gap * gap) * inverse[d] ** 2
            told[2] += log_std[d] + half_log_2pi + 0.5 * spread
            slopes[i, d] = (pull * z * inverse[d] + choices.beta * gap * inverse[d] ** 2) / n
            log_std_gradient[d] += (pull * (z * z - 1) + choices.beta * (1 - spread)) / n


@loose_kernel
def categorical_head(
    logits: np.ndarray, rows: np.ndarray, choices: Choices, slopes: np.ndarray, told: np.ndarray
) -> None:
    """Fill ∂L/∂logits (b, A) of −L_clip − c·H(π) + β·H(T‖π), means over a minibatch.

    ∂log π(a)/∂x_j = 1[a = j] − π_j   ∂H(π)/∂x_j = −π_j·(log π_j + H(π))   ∂H(T‖π)/∂x_j = π_j − T_j
    """
    n = len(rows)
    for i in range(n):
        row, top, total, log_prob, entropy = rows[i], logits[i].max(), 0.0, 0.0, 0.0
        for j in range(logits.shape[1]):
            total += exp(logits[i, j] - top)
        normaliser = top + log(total)
        for j in range(logits.shape[1]):
            log_pi = logits[i, j] - normaliser
            log_prob += choices.actions[row, j] * log_pi
            entropy -= exp(log_pi) * log_pi
            told[2] -= exp(choices.teacher[row, j]) * log_pi
        told[1] += entropy
        pull = surrogate(
            log_prob - choices.behavior_log_probs[row], choices.advantages[row],
            choices.clip_range, told,
        )  # fmt: skip
        for j in range(logits.shape[1]):
            log_pi = logits[i, j] - normaliser
            prob, teacher = exp(log_pi), exp(choices.teacher[row, j])
            slope = pull * (choices.actions[row, j] - prob) + choices.beta * (prob - teacher)
            slopes[i, j] = (slope + choices.ent_coef * prob * (log_pi + entropy)) / n


@loose_kernel
def gathered(batch: Batch, rows: np.ndarray, room: np.ndarray) -> np.ndarray:
    """Return the observations of a minibatch, (b, O), laid one after the other in `room`."""
    for i in range(len(rows)):
        room[i] = batch.obs[rows[i]]
    return room[: len(rows)]


@loose_kernel
def learn_policy(
    tower: Tower,
    row: Row,
    log_std: np.ndarray,
    log_std_gradient: np.ndarray,
    batch: Batch,
    choices: Choices,
    told: np.ndarray,
) -> int:
    """Take all epochs' steps of a policy; return how many, fewer where a loss was not finite.

    `told` (steps, 6) gets each step's means, named by POLICY_NUMBERS.
    """
    head, step = len(tower.weights) - 1, 0
    room = np.empty((batch.size, batch.obs.shape[1]), np.float32)
    for order in batch.order:
        for start in range(0, len(order), batch.size):
            rows = order[start : start + batch.size]
            x = gathered(batch, rows, room)
            forward(x, tower)
            out, slopes = tower.outputs[head][: len(rows)], tower.slopes[head]
            if choices.discrete:
                categorical_head(out, rows, choices, slopes, told[step])
            else:
                gaussian_head(out, log_std, rows, choices, slopes, log_std_gradient, told[step])
            told[step] /= len(rows)
            step += 1
            if not np.isfinite(told[step - 1, :3]).all():
                return step
            backward(x, tower)
            adam(row, row.steps + step)
    return step


@loose_kernel
def learn_value(
    tower: Tower, row: Row, batch: Batch, returns: np.ndarray, vf_coef: float, told: np.ndarray
) -> int:
    """Take all epochs' steps of a critic on c·(V − R̂)²; see `learn_policy`; told is (steps, 1)."""
    head, step = len(tower.weights) - 1, 0
    room = np.empty((batch.size, batch.obs.shape[1]), np.float32)
    for order in batch.order:
        for start in range(0, len(order), batch.size):
            rows = order[start : start + batch.size]
            x = gathered(batch, rows, room)
            forward(x, tower)
            for i in range(len(rows)):
                error = tower.outputs[head][i, 0] - returns[rows[i]]
                told[step, 0] += error * error / len(rows)
                tower.slopes[head][i, 0] = 2 * vf_coef * error / len(rows)
            step += 1
            if not np.isfinite(told[step - 1, 0]):
                return step
            backward(x, tower)
            adam(row, row.steps + step)
    return step
