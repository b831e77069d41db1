"""How large the signals of a motor get for inputs of a given size: what priors are measured by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from motor_sysid.estimation.online.coordinates import VANISHING
from motor_sysid.physics.effect import Amplitude
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales

Array = NDArray[np.float64]

_RECORD = 10.0
_UNIFORM = 12**-0.5
_STEPS = 1000
_PRIOR_AMPLITUDE = 0.5
_PRIOR_LOG = 0.7
_PRIOR_BIAS = 0.1
_LEAST = 0.02
_SLOW = 0.05


@dataclass(frozen=True)
class Sizes:
    """Sizes of states and forces of a motor that is driven by inputs of a certain size.

    Attributes
    ----------
    state:
        (n,) largest absolute value of each state in the answer to a step of the input.
    force:
        (m,) torque, voltage ... that keeps its own state at zero against the input.
    """

    state: Array
    force: Array

    @classmethod
    def per_unit(cls, model: Model) -> 'Sizes':
        """Return the sizes for a unit step, from the linear core of the model."""
        kind = model.kind
        values = {p.name: np.array([p.value]) for p in model.parameters}
        a, b, g = (part[0] for part in kind.like(values))
        leak, drive = a - np.eye(len(a)) / _RECORD, b.sum(axis=1)
        rise = np.linalg.solve(leak, -np.column_stack([drive, g]))
        own = [kind.states.index(force.own_state) for force in kind.forces]
        force = [abs(rise[j, 0] / rise[j, 1 + k]) for k, j in enumerate(own)]
        top = np.maximum(np.abs(rise[:, 0]), _peak(leak, drive))
        return cls(np.maximum(top, 1e-12), np.maximum(force, 1e-12))

    def seen(self, size: float, states: Array) -> 'Sizes':
        """Return the sizes for inputs of `size` where states (n,) have grown that large.

        What was seen of a state counts within a twentieth to the whole of what the input can do.
        """
        able = self.state * size
        return Sizes(np.clip(states, _SLOW * able, able), self.force * size)


def prior_sigma(model: Model, names: Sequence[str], sizes: Sizes, dt: float) -> Array:
    """Return the standard deviation of each coordinate before any data.

    A known sigma is taken (2 % at least); without one, what must be positive is good to a factor
    of two, friction to its own value, an amplitude to half of its scale (a lag and the like to its
    own value, where that is more), an offset to a tenth of its signal; none is less known than
    anything within its bounds.
    """
    typical = _scales(model, sizes, dt)
    spread = {
        f'{key}.{card.name}': max(
            _PRIOR_AMPLITUDE * typical.size(card.scale),
            abs(model[f'{key}.{card.name}']) if card.trials else 0.0,
        )
        for key in model.effects
        for card in effect(key).card.parameters
        if isinstance(card, Amplitude)
    }
    for output in model.kind.outputs:
        spread[output.bias] = _PRIOR_BIAS * sizes.state[model.kind.states.index(output.state)]
    largest = max((s for n, s in zip(model.kind.states, sizes.state, strict=True)
                   if n in model.kind.currents), default=1.0)
    spread |= dict.fromkeys(model.kind.shown, _PRIOR_BIAS * largest)
    return np.array([_spread(model, name, spread) for name in names])


def _spread(model: Model, name: str, spread: dict[str, float]) -> float:
    p = model.parameters[name]
    logarithm = p.lower > VANISHING
    anything = _UNIFORM * (p.upper - p.lower)
    size = p.value if logarithm else min(spread.get(name, abs(p.value) or 1.0), anything)
    if p.sigma is not None and np.isfinite(p.sigma) and p.sigma > 0:
        known = max(p.sigma, _LEAST * size)
        return float(known / size if logarithm else known)
    return _PRIOR_LOG if logarithm else size


def _scales(model: Model, sizes: Sizes, dt: float) -> Scales:
    state = dict(zip(model.kind.states, sizes.state, strict=True))
    force = dict(zip([f.name for f in model.kind.forces], sizes.force, strict=True))
    current = max((state[name] for name in model.kind.currents), default=1.0)
    voltage = max((f for name, f in force.items() if name != 'torque'), default=1.0)
    return Scales(
        torque=force['torque'],
        speed=state['omega'],
        current=current,
        voltage=voltage,
        sample=dt,
        duration=_RECORD,
        loss=model.parameters.values().get('R', 1.0) * current**2,
    )


def _peak(a: Array, drive: Array) -> Array:
    """Largest absolute value of each state while the fastest ones answer a step."""
    h = 0.1 / float(np.max(np.abs(np.linalg.eigvals(a))))
    block = np.zeros((len(a) + 1, len(a) + 1))
    block[:-1, :-1], block[:-1, -1] = a * h, drive * h
    step = expm(block)
    x, top = np.append(np.zeros(len(a)), 1.0), np.zeros(len(a))
    for _ in range(_STEPS):
        x = step @ x
        top = np.maximum(top, np.abs(x[:-1]))
    return top
