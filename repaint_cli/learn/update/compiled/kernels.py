"""Small dense networks, their derivatives and Adam, compiled: one policy or one critic at a time.

The derivatives are those of `losses` and `distributions`. The records are here because numba's
cache depends on changes of this file only. Shapes: n samples of a seed, b of them in a minibatch, O
observation, A actions, P parameters of a network, which is a policy or a critic.
"""

from math import exp, expm1, inf, log, pi, sqrt
from typing import NamedTuple

import numpy as np

from repaint_cli.kernels import fastmath_kernel


class NetworkView(NamedTuple):
    """A policy or a critic of one seed: its layers, the head last, and a minibatch's workspace."""

    weights: tuple[np.ndarray, ...]  # (in, out) of each layer
    weight_gradients: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]  # (out,) of each layer
    bias_gradients: tuple[np.ndarray, ...]
    inputs: np.ndarray  # workspace: a minibatch's observations, (b, O)
    outputs: tuple[np.ndarray, ...]  # workspace: what each layer puts out, (b, out)
    slopes: tuple[np.ndarray, ...]  # workspace: ∂L/∂(x·W + b) of each layer, (b, out)


class AdamView(NamedTuple):
    """The same network as Adam reads it: flat arrays, (P,) each."""

    parameters: np.ndarray  # θ
    gradients: np.ndarray  # ∂L/∂θ
    first: np.ndarray  # first moments
    second: np.ndarray  # second moments
    steps: int  # taken before
    learning_rate: float
    epsilon: float
    max_grad_norm: float  # c, infinite where there is none


class PolicyData(NamedTuple):
    """What one seed's policy learns from at each sample, and the coefficients of its loss."""

    discrete: bool  # whether the policy is categorical; otherwise it is Gaussian
    actions: np.ndarray  # a, (n, A); a one-hot row where discrete
    behavior_log_probs: np.ndarray  # log μ(a|s), (n,)
    advantages: np.ndarray  # Â, (n,)
    teacher: np.ndarray  # the teacher's mean, or log-probabilities, (n, A)
    teacher_log_std: np.ndarray  # log τ of a Gaussian teacher, (n, A)
    clip_range: float  # ε
    ent_coef: float  # weight of the entropy bonus
    beta: float  # β_k, weight of the cross-entropy


@fastmath_kernel
def tanh(x: np.float32) -> np.float32:
    """Return tanh x to 3·10⁻⁷ by Lambert's fraction at x/4, then twice tanh 2y = 2t/(1 + t²)."""
    f4 = np.float32
    x = f4(9) if x > f4(9) else x  # a nan stays one
    x = f4(-9) if x < f4(-9) else x
    y = x * f4(0.25)
    s = y * y
    over = f4(135135) + s * (f4(17325) + s * (f4(378) + s))
    under = f4(135135) + s * (f4(62370) + s * (f4(3150) + s * f4(28)))
    t = y * over / under
    t = f4(2) * t / (f4(1) + t * t)
    return f4(2) * t / (f4(1) + t * t)


@fastmath_kernel
def forward(obs: np.ndarray, rows: np.ndarray, network: NetworkView) -> None:
    """Fill each layer's outputs, tanh(x·W + b), the head's without tanh, for rows of obs (n, O)."""
    head, x = len(network.weights) - 1, network.inputs[: len(rows)]
    for i in range(len(rows)):
        x[i] = obs[rows[i]]
    for layer in range(head + 1):
        out, bias = network.outputs[layer][: len(x)], network.biases[layer]
        np.dot(x, network.weights[layer], out)
        for i in range(len(x)):
            if layer == head:
                for j in range(len(bias)):
                    out[i, j] += bias[j]
            else:
                for j in range(len(bias)):
                    out[i, j] = tanh(out[i, j] + bias[j])
        x = out


@fastmath_kernel
def backward(n: int, network: NetworkView) -> None:
    """Fill the gradients from the head's slopes ∂L/∂out of the n samples that `forward` saw."""
    x = network.inputs[:n]
    for layer in range(len(network.weights) - 1, -1, -1):
        slope = network.slopes[layer][: len(x)]
        below = network.outputs[layer - 1][: len(x)] if layer else x
        np.dot(below.T, slope, network.weight_gradients[layer])
        bias_gradient = network.bias_gradients[layer]
        bias_gradient[:] = 0
        for i in range(len(x)):
            for j in range(len(bias_gradient)):
                bias_gradient[j] += slope[i, j]
        if layer:
            under = network.slopes[layer - 1][: len(x)]
            np.dot(slope, network.weights[layer].T, under)
            for i in range(len(x)):  # tanh′ = 1 − tanh²
                for j in range(under.shape[1]):
                    under[i, j] *= np.float32(1) - below[i, j] * below[i, j]


@fastmath_kernel
def adam(view: AdamView, step: int) -> None:
    """Take Adam's step number `step` (Kingma & Ba 2015, algorithm 1), β₁ = 0.9, β₂ = 0.999.

    A gradient that is too long is scaled down first: g ← g·min(1, c/(‖g‖ + 10⁻⁶)).
    """
    if view.max_grad_norm < inf:
        shrink = view.max_grad_norm / (sqrt(np.dot(view.gradients, view.gradients)) + 1e-6)
        view.gradients[:] *= np.float32(min(shrink, 1.0))
    rate = np.float32(view.learning_rate / (1 - 0.9**step))
    scale = np.float32(1 / sqrt(1 - 0.999**step))
    for i in range(len(view.parameters)):
        g = view.gradients[i]
        view.first[i] += np.float32(1 - 0.9) * (g - view.first[i])
        view.second[i] = np.float32(0.999) * view.second[i] + np.float32(1 - 0.999) * g * g
        spread = np.sqrt(view.second[i]) * scale + np.float32(view.epsilon)
        view.parameters[i] -= rate * view.first[i] / spread


@fastmath_kernel
def surrogate(log_prob: float, row: int, data: PolicyData, metrics: np.ndarray) -> float:
    """Return ∂/∂log π of −min(ρA, clip(ρ)·A) at a sample, and add to the minibatch's metrics."""
    log_ratio, advantage = log_prob - data.behavior_log_probs[row], data.advantages[row]
    ratio = exp(log_ratio)
    clipped = min(max(ratio, 1 - data.clip_range), 1 + data.clip_range) * advantage
    metrics[0] -= min(ratio * advantage, clipped)
    metrics[3] += expm1(log_ratio) - log_ratio
    metrics[4] += abs(ratio - 1) > data.clip_range
    metrics[5] += log_ratio
    return -ratio * advantage if ratio * advantage <= clipped else 0.0


@fastmath_kernel
def gaussian_head(
    means: np.ndarray, log_std: np.ndarray, rows: np.ndarray, data: PolicyData,
    slopes: np.ndarray, log_std_gradient: np.ndarray, metrics: np.ndarray,
) -> None:  # fmt: skip
    """Fill ∂L/∂μ (b, A) and ∂L/∂log σ (A,) of −L_clip − c·H(π) + β·H(T‖π), means over a minibatch.

    ∂log π/∂μ = z/σ            ∂log π/∂log σ = z² − 1          z = (a − μ)/σ
    ∂H(T‖π)/∂μ = (μ − m)/σ²    ∂H(T‖π)/∂log σ = 1 − (τ² + (m − μ)²)/σ²
    """
    n, half_log_2pi = len(rows), 0.5 * log(2 * pi)
    inverse = np.exp(-log_std)  # 1/σ
    log_std_gradient[:] = -data.ent_coef
    metrics[1] += n * (log_std + half_log_2pi + 0.5).sum()
    for i in range(n):
        row, log_prob = rows[i], 0.0
        for d in range(len(log_std)):
            z = (data.actions[row, d] - means[i, d]) * inverse[d]
            log_prob -= 0.5 * z * z + log_std[d] + half_log_2pi
        pull = surrogate(log_prob, row, data, metrics)
        for d in range(len(log_std)):
            z = (data.actions[row, d] - means[i, d]) * inverse[d]
            gap = means[i, d] - data.teacher[row, d]
            spread = (exp(2 * data.teacher_log_std[row, d]) + gap * gap) * inverse[d] ** 2
            metrics[2] += log_std[d] + half_log_2pi + 0.5 * spread
            slopes[i, d] = (pull * z * inverse[d] + data.beta * gap * inverse[d] ** 2) / n
            log_std_gradient[d] += (pull * (z * z - 1) + data.beta * (1 - spread)) / n


@fastmath_kernel
def categorical_head(
    logits: np.ndarray, rows: np.ndarray, data: PolicyData, slopes: np.ndarray, metrics: np.ndarray
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
            log_prob += data.actions[row, j] * log_pi
            entropy -= exp(log_pi) * log_pi
            metrics[2] -= exp(data.teacher[row, j]) * log_pi
        metrics[1] += entropy
        pull = surrogate(log_prob, row, data, metrics)
        for j in range(logits.shape[1]):
            log_pi = logits[i, j] - normaliser
            prob, teacher = exp(log_pi), exp(data.teacher[row, j])
            slope = pull * (data.actions[row, j] - prob) + data.beta * (prob - teacher)
            slopes[i, j] = (slope + data.ent_coef * prob * (log_pi + entropy)) / n


@fastmath_kernel
def learn_policy(
    network: NetworkView, view: AdamView, log_std: np.ndarray, log_std_gradient: np.ndarray,
    obs: np.ndarray, orders: np.ndarray, data: PolicyData, target_kl: float, metrics: np.ndarray,
) -> int:  # fmt: skip
    """Take a policy's steps, up to the target KL or a loss that is not finite; return how many.

    The orders are (epochs, n), the observations (n, O) normalised. Metrics (steps, 6) are means of
    a step: surrogate loss, entropy, cross-entropy, approximate KL, clip fraction and log ratio.
    """
    head, step, size = len(network.weights) - 1, 0, len(network.inputs)
    for order in orders:
        for start in range(0, len(order), size):
            rows = order[start : start + size]
            forward(obs, rows, network)
            out, slopes = network.outputs[head][: len(rows)], network.slopes[head]
            if data.discrete:
                categorical_head(out, rows, data, slopes, metrics[step])
            else:
                gaussian_head(out, log_std, rows, data, slopes, log_std_gradient, metrics[step])
            metrics[step] /= len(rows)
            step += 1
            if not np.isfinite(metrics[step - 1, :3]).all():
                return step
            backward(len(rows), network)
            adam(view, view.steps + step)
        if metrics[step + -len(order) // size : step, 3].mean() > target_kl:  # of this epoch
            break
    return step


@fastmath_kernel
def learn_value(
    network: NetworkView, view: AdamView, obs: np.ndarray, orders: np.ndarray,
    returns: np.ndarray, vf_coef: float, metrics: np.ndarray,
) -> int:  # fmt: skip
    """Take a critic's steps on c·(V − R̂)²; see `learn_policy`. Metrics (steps, 1) are its means."""
    head, step, size = len(network.weights) - 1, 0, len(network.inputs)
    for order in orders:
        for start in range(0, len(order), size):
            rows = order[start : start + size]
            forward(obs, rows, network)
            for i in range(len(rows)):
                error = network.outputs[head][i, 0] - returns[rows[i]]
                metrics[step, 0] += error * error / len(rows)
                network.slopes[head][i, 0] = 2 * vf_coef * error / len(rows)
            step += 1
            if not np.isfinite(metrics[step - 1, 0]):
                return step
            backward(len(rows), network)
            adam(view, view.steps + step)
    return step
