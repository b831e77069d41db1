"""Linear effects join the linear motor: solved exactly with it, whatever their time constants.

An effect whose card says `linear` has laws and rates that are linear in states and inputs (the
filter of a sensor, a springy shaft).  Its own states become further states of the core,

    d/dt (x, z) = [[A + G F_x, G F_z], [R_x, R_z]] (x, z) + [[B + G F_u], [R_u]] u + [[G], [0]] f,

whose blocks are the laws evaluated at unit vectors.  A current that settles within a tenth of a
sample, and what a filter makes of it, is then right to rounding.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from motor_sysid.physics.effect import arguments, Effect, Law
from motor_sysid.physics.motors.base import Matrices, Motor

Array = NDArray[np.float64]

_APART, _SMALL = 1e-6, 1e-6
"""Relative distance that keeps equal poles apart, and the size below which a series is used."""


class LinearEffects:
    """The linear effects of a model.

    Parameters
    ----------
    kind:
        Motor kind.
    effects:
        Its linear effects, in the model's order.
    """

    def __init__(self, kind: Motor, effects: Sequence[Effect]) -> None:
        self.kind, self.effects = kind, tuple(effects)
        self.count = sum(len(one.card.states) for one in effects)

    def extended(self, matrices: Matrices, values: Mapping[str, Array]) -> Matrices:
        """Return A (W, n + s, n + s), B (W, n + s, n_u), G (W, n + s, m) with s own states.

        Parameters
        ----------
        matrices:
            Those of the motor alone.
        values:
            Every parameter name to (W,) values.
        """
        if not self.effects:
            return matrices
        a, b, g = (np.asarray(part) for part in matrices)
        n, size = a.shape[1], a.shape[1] + self.count
        whole = np.zeros((len(a), size, size + b.shape[2]))
        whole[:, :n, :n], whole[:, :n, size:] = a, b
        row = n
        for one in self.effects:
            columns = self._columns(one, row, size)
            for name, law in one.laws.items():
                at = [j for j, force in enumerate(self.kind.forces) if force.name == name]
                for j in at:
                    slope = self._slope(one, law, columns, values, whole.shape[2])
                    whole[:, :n] += g[:, :, j, None] * slope[:, None, :]
            for rate in one.rates.values():
                whole[:, row] = self._slope(one, rate, columns, values, whole.shape[2])
                row += 1
        forces = np.concatenate((g, np.zeros((len(g), self.count, g.shape[2]))), axis=1)
        return whole[:, :, :size], whole[:, :, size:], forces

    def _columns(self, one: Effect, row: int, size: int) -> dict[str, int]:
        """Return where each state and input stands among the columns of (A, B)."""
        names = {name: j for j, name in enumerate(self.kind.states)}
        names |= {name: row + j for j, name in enumerate(one.card.states)}
        return names | {name: size + j for j, name in enumerate(self.kind.arguments)}

    def _slope(
        self,
        one: Effect,
        law: Law,
        columns: Mapping[str, int],
        values: Mapping[str, Array],
        width: int,
    ) -> Array:
        """Return (W, columns): the law at each unit vector."""
        own = {p.name for p in one.card.parameters}
        asked = arguments(law)
        held: dict[str, Array | float] = {
            name: 0.0 if name in columns else values[f'{one.key}.{name}' if name in own else name]
            for name in asked
        }
        slope = np.zeros((len(next(iter(values.values()))), width))
        for name in asked:
            if name in columns:
                slope[:, columns[name]] = law(**{**held, name: 1.0})
        return slope


def along(
    one: Effect, kind: Motor, values: Mapping[str, float], states: Mapping[str, Array], dt: float
) -> dict[str, Array]:
    """Return the own states (N,) of a linear effect where the motor moves as given.

    Exact for states that are straight lines between the samples.

    Parameters
    ----------
    one:
        The effect.
    kind, values:
        The motor, and every parameter by name.
    states:
        State or input to (N,) values; one that is not given counts as zero.
    dt:
        Sample time in s.
    """
    own, names = one.card.states, (*kind.states, *kind.arguments)
    only = LinearEffects(kind, [one])
    table = {name: np.array([value]) for name, value in values.items()}
    a, b, _ = only.extended(kind.matrices(table), table)
    n = len(kind.states)
    given = [j for j, name in enumerate(names) if name in states]
    moved = np.concatenate((a[0, n:, :n], b[0, n:]), axis=1)[:, given]
    inner = a[0, n:, n:]
    fastest = np.max(np.abs(np.linalg.eigvals(inner)))
    rates, vectors = np.linalg.eig(inner + np.diag(_APART * fastest * np.arange(len(own))))
    drive = np.linalg.solve(vectors, moved) @ np.stack([states[names[j]] for j in given])
    first = [states[one.card.begins[s]][0] if s in one.card.begins else 0.0 for s in own]
    mode = np.linalg.solve(vectors, np.array(first, dtype=complex))
    paths = np.empty(drive.shape, dtype=complex)
    for k, rate in enumerate(rates):
        z = rate * dt
        held = np.expm1(z) / z if abs(z) > _SMALL else 1 + z / 2
        bent = (held - 1) / z if abs(z) > _SMALL else 0.5 + z / 6
        force = dt * (held * drive[k, :-1] + bent * np.diff(drive[k]))
        paths[k] = lfilter([1.0], [1.0, -np.exp(z)], np.concatenate(([mode[k]], force)))
    path = (vectors @ paths).real
    return dict(zip(own, path, strict=True))
