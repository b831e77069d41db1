"""The linear part of a model as matrices in JSON, for python-control, scipy and anything else."""

import json
import re

import numpy as np

from motor_sysid.export import words
from motor_sysid.export.linear import linear_plant
from motor_sysid.export.settings import Settings
from motor_sysid.physics.model import Model

TITLE = 'linear part as matrices A, B, C, D, with poles (JSON)'
SUFFIX = '.json'
USES = ('rate',)


def write(model: Model, settings: Settings) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what is left out; discrete matrices besides, if there is a rate."""
    plant = linear_plant(model)
    content: dict[str, object] = {
        'schema': 'motor_sysid/state_space/1',
        'about': words.heading(model),
        'equations': 'dx/dt = A x + B u(t - input_delay), y = C x + D u',
        'A': plant.a.tolist(), 'B': plant.b.tolist(), 'C': plant.c.tolist(),
        'D': plant.d.tolist(),
        **{
            what: [{'name': name, 'unit': unit} for name, unit in getattr(plant, what)]
            for what in ('states', 'inputs', 'outputs')
        },
        'input_delay': plant.delay,
        'poles': [[p.real, p.imag] for p in np.linalg.eigvals(plant.a).tolist()],
    }  # fmt: skip
    if settings.rate:
        a, b = plant.held(1.0 / settings.rate)
        content |= {'sample_time': 1.0 / settings.rate, 'A_d': a.tolist(), 'B_d': b.tolist()}
    content['left_out'] = list(plant.left_out)
    content['parameters'] = {
        p.name: {'value': p.value, 'unit': p.unit, 'sigma': _finite(p.sigma)}
        for p in model.parameters
    }
    return _compact(json.dumps(content, indent=1, allow_nan=False)) + '\n', plant.left_out


def _compact(text: str) -> str:
    """Return JSON with each row of numbers on one line."""
    return re.sub(r'\[[\s\d.,e+-]*\]', lambda row: ' '.join(row[0].split()), text)


def _finite(sigma: float | None) -> float | None:
    return None if sigma is None or np.isinf(sigma) else sigma
