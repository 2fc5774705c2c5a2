"""The Hermite polynomial through states and rates of a history, to extrapolate beyond them.

With nodes t_j, L_j = Π_k≠j (t - t_k) / (t_j - t_k) and s_j = Σ_k≠j 1 / (t_j - t_k),

    y(t) = Σ_j (1 - 2 (t - t_j) s_j) L_j² y_j + (t - t_j) L_j² y'_j

(Stoer & Bulirsch, Introduction to Numerical Analysis, 3rd edition, section 2.1.5).  ``history`` is a
``layout.History``; the rows of its nodes stand in ``history.nodes``.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel

OF_STATE, OF_RATE = range(2)  # rows of the weights


@kernel
def find_weights(history, count, t):
    """Weights of the states and rates of the first ``count`` nodes in y(t)."""
    time, nodes, weights = history.time, history.nodes, history.weights
    for j in range(count):
        own, basis, sum_ = time[nodes[j]], 1.0, 0.0
        for k in range(count):
            if k != j:
                width = own - time[nodes[k]]
                basis *= (t - time[nodes[k]]) / width
                sum_ += 1.0 / width
        square, off = basis * basis, t - own
        weights[OF_STATE, j] = (1.0 - 2.0 * off * sum_) * square
        weights[OF_RATE, j] = off * square


@kernel
def extrapolate(history, count, t, y):
    """y(t) of the polynomial through the first ``count`` nodes."""
    find_weights(history, count, t)
    combine(history, count, y)


@kernel
def combine(history, count, target):
    """``target`` := Σ_j weights[OF_STATE, j] y_j + weights[OF_RATE, j] y'_j."""
    nodes, weights = history.nodes, history.weights
    target[:] = 0.0
    for j in range(count):
        of_state, of_rate, node = weights[OF_STATE, j], weights[OF_RATE, j], nodes[j]
        for i in range(target.shape[0]):
            target[i] += of_state * history.y[node, i] + of_rate * history.y_rate[node, i]
