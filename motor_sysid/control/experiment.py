"""Run a model as if it were a motor on a bench: an input or a controller, and sensors."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.control.pid import Pid
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.physics.stepper import Stepper
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.phases import sector_at
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]
Sense = Callable[[Stepper], Mapping[str, float]]
"""A motor, now, to what its sensors show."""


def run_open(
    model: Model,
    inputs: Mapping[str, Array],
    dt: float,
    sense: Sense,
    *,
    substeps: int = 4,
) -> Record:
    """Run a model under given inputs.

    A motor that is known by its Hall sectors shows them, too: those of its true angle.

    Parameters
    ----------
    model:
        The model.
    inputs:
        A full set of inputs of the motor kind: signal to (N,) values, each held for one sample.
    dt:
        Sample time in s.
    sense:
        The sensors.
    substeps:
        Integration steps per sample.
    """
    names = _input_names(model, tuple(inputs))
    table = np.column_stack([inputs[name] for name in names])
    plant, rows = Stepper(model, dt, substeps), []
    for u in table:
        rows.append({**sense(plant), **_sectors(plant)})
        plant.step(u.tolist())
    return _record(model, dt, rows, {name: table[:, j] for j, name in enumerate(names)})


def _sectors(plant: Stepper) -> dict[str, float]:
    """Return the Hall sector of a motor whose kind has them, now."""
    model = plant.model
    if 'hall_sector' not in model.kind.tells:
        return {}
    angle = model['pole_pairs'] * plant.state['theta'] + model['angle_offset']
    return {'hall_sector': float(sector_at(angle))}


def run_closed(
    model: Model,
    reference: Array,
    controller: Pid,
    dt: float,
    sense: Sense,
    *,
    substeps: int = 4,
) -> Record:
    """Run a model under a speed controller, whose measured speed is that of the sensors.

    Parameters
    ----------
    reference:
        (N,) speed reference in rad/s (m/s on a linear axis).
    controller:
        From speed error to the input of the motor kind, which must be a single one.
    model, dt, sense, substeps:
        See `run_open`.
    """
    name = _input_names(model, model.kind.inputs[0])[0]
    plant, rows = Stepper(model, dt, substeps), []
    applied = np.empty(reference.size)
    for k, wanted in enumerate(reference.tolist()):
        rows.append(dict(sense(plant)))
        applied[k] = controller.step(wanted, rows[-1]['speed'], dt)
        plant.step(float(applied[k]))
    return _record(model, dt, rows, {name: applied, 'speed_reference': reference})


def _input_names(model: Model, names: Sequence[str]) -> tuple[str, ...]:
    for known in model.kind.inputs:
        if set(known) == set(names):
            return known
    wanted = ' or '.join('+'.join(known) for known in model.kind.inputs)
    raise UserError(f'a {model.kind.title} is driven by {wanted}, not by {"+".join(names)}')


def _record(
    model: Model, dt: float, rows: Sequence[Mapping[str, float]], driven: Mapping[str, Array]
) -> Record:
    signals = dict(driven)
    for name in rows[0]:
        signals[name] = np.array([row[name] for row in rows])
    time = dt * np.arange(len(rows), dtype=np.float64)
    units = {name: unit_of(name, linear=model.linear) for name in signals}
    return Record(time, signals, units, Provenance('simulated'))


def unit_of(signal: str, *, linear: bool) -> str:
    """Return the SI unit of a canonical signal, on a rotary or a linear axis."""
    units = BY_NAME[signal].units
    return units[-1] if linear else units[0]
