"""The formulas of the papers, one coordinate of one member at a time.

Each function draws the random numbers in the order in which the optimizer does, and then does what
the paper says in plain loops; the optimizers do it for all members at once.
"""

import numpy as np

from motor_sysid.estimation.batch.optimizers.base import latin_hypercube


class State:
    """What a formula may know: points x, their costs, the best, the part of the budget."""

    def __init__(self, points, costs, progress, rng):
        self.x, self.costs, self.late, self.rng = points, costs, progress, rng
        self.best = points[int(np.argmin(costs))]
        self.worst = points[int(np.argmax(costs))]
        self.count, self.d = points.shape

    def loop(self, rule):
        return np.array([[rule(i, j) for j in range(self.d)] for i in range(self.count)])


def pso(s):
    _, r2 = s.rng.random((2, s.count, s.d))
    chi = 0.7298437881

    def rule(i, j):
        v = chi * 2.05 * r2[i, j] * (s.best[j] - s.x[i, j])  # its own best is where it is
        return s.x[i, j] + min(max(v, -0.4), 0.4)

    return s.loop(rule)


def pso_inertia(s):
    _, r2 = s.rng.random((2, s.count, s.d))

    def rule(i, j):
        return s.x[i, j] + min(max(1.5 * r2[i, j] * (s.best[j] - s.x[i, j]), -0.4), 0.4)

    return s.loop(rule)


def gwo(s):
    order = np.argsort(s.costs)[:3]
    r1, r2 = s.rng.random((2, 3, s.count, s.d))
    a = 2 - 2 * s.late

    def rule(i, j):
        total = 0.0
        for k, leader in enumerate(s.x[order]):
            big_a, big_c = 2 * a * r1[k, i, j] - a, 2 * r2[k, i, j]
            total += leader[j] - big_a * abs(big_c * leader[j] - s.x[i, j])
        return total / 3

    return s.loop(rule)


def woa(s):
    r, c, p = s.rng.random((3, s.count, 1))[:, :, 0]
    whale = s.rng.integers(s.count, size=s.count)
    turn = s.rng.uniform(-1, 1, (s.count, 1))[:, 0]
    a = 2 - 2 * s.late

    def rule(i, j):
        big_a, big_c = 2 * a * r[i] - a, 2 * c[i]
        if p[i] >= 0.5:
            away = abs(s.best[j] - s.x[i, j])
            return away * np.exp(turn[i]) * np.cos(2 * np.pi * turn[i]) + s.best[j]
        goal = s.best if abs(big_a) < 1 else s.x[whale[i]]
        return goal[j] - big_a * abs(big_c * goal[j] - s.x[i, j])

    return s.loop(rule)


def sca(s):
    r2, r3, r4 = s.rng.random((3, s.count, s.d))

    def rule(i, j):
        wave = np.sin if r4[i, j] < 0.5 else np.cos
        away = abs(2 * r3[i, j] * s.best[j] - s.x[i, j])
        return s.x[i, j] + 2 * (1 - s.late) * wave(2 * np.pi * r2[i, j]) * away

    return s.loop(rule)


def gsa(s):
    m = (s.costs - s.costs.max()) / (s.costs.min() - s.costs.max())
    m = m / m.sum()
    strong = np.argsort(-m)[: round(s.count * (1 - s.late))]
    r = s.rng.random((s.count, strong.size, s.d))
    s.rng.random((s.count, s.d))  # what is kept of no velocity

    def rule(i, j):
        pull = 0.0
        for n, k in enumerate(strong):
            distance = np.linalg.norm(s.x[i] - s.x[k])
            gravity = np.exp(-20 * s.late)
            if k != i:
                pull += r[i, n, j] * gravity * m[k] * (s.x[k, j] - s.x[i, j]) / distance
        return s.x[i, j] + pull

    return s.loop(rule)


def jaya(s):
    r1, r2 = s.rng.random((2, s.count, s.d))

    def rule(i, j):
        x = s.x[i, j]
        return x + r1[i, j] * (s.best[j] - x) - r2[i, j] * (s.worst[j] - x)

    return s.loop(rule)


def rao(s):
    r = s.rng.random((s.count, s.d))
    return s.loop(lambda i, j: s.x[i, j] + r[i, j] * (s.best[j] - s.worst[j]))


def tlbo(s):
    r = s.rng.random((s.count, s.d))
    factor = s.rng.integers(1, 3, size=(s.count, 1))[:, 0]
    mean = [sum(s.x[:, j]) / s.count for j in range(s.d)]
    return s.loop(lambda i, j: s.x[i, j] + r[i, j] * (s.best[j] - factor[i] * mean[j]))


def de(s):
    order = s.rng.random((s.count, s.count))
    luck = s.rng.random((s.count, s.d - 1))
    first = s.rng.integers(s.d, size=s.count)
    trials = s.x.copy()
    for i in range(s.count):
        a, b, c = [k for k in np.argsort(order[i]) if k != i][:3]
        j, copied = first[i], 0
        while True:
            trials[i, j] = s.x[a, j] + 0.5 * (s.x[b, j] - s.x[c, j])
            j, copied = (j + 1) % s.d, copied + 1
            if copied == s.d or luck[i, copied - 1] >= 0.9:
                break
    return trials


def aoa(s):
    moa = s.rng.random((s.count, s.d))
    r2, r3 = s.rng.random((2, s.count, s.d))
    p = 1 - s.late ** (1 / 5)

    def rule(i, j):
        unit = (s.best[j] + 1) / 2
        if moa[i, j] >= 0.2 + 0.8 * s.late:
            new = unit / (p + 2.2e-16) * 0.499 if r2[i, j] < 0.5 else unit * p * 0.499
        else:
            new = unit - p * 0.499 if r3[i, j] < 0.5 else unit + p * 0.499
        return 2 * new - 1

    return s.loop(rule)


FORMULAS = {
    'pso': pso, 'pso_inertia': pso_inertia, 'gwo': gwo, 'woa': woa, 'sca': sca, 'gsa': gsa,
    'jaya': jaya, 'rao': rao, 'tlbo': tlbo, 'de': de, 'aoa': aoa,
}  # fmt: skip


def check(method, optimizer, rng):
    """Compare the first move of an optimizer with the formula; `rng` begins as its own did."""
    first = optimizer.ask()
    latin_hypercube(*first.shape, rng)
    costs = np.sum((first - 0.1) ** 2, axis=1)
    optimizer.tell(costs)
    expected = FORMULAS[method](State(first, costs, optimizer.progress, rng))
    found = optimizer.ask()
    inside = np.abs(expected) < 1.0
    assert np.mean(inside) > 0.5
    np.testing.assert_allclose(found[inside], expected[inside], rtol=1e-9, atol=1e-12)
    assert np.max(np.abs(found)) <= 1.0
