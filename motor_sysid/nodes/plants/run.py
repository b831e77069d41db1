"""Run a simulated motor under speed control, without ROS, and keep what its sensors show."""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.control.pid import Pid
from motor_sysid.nodes.plants.base import Plant
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.record import Provenance, Record

AXES = {'dc': ('',), 'dq': ('_d', '_q'), 'abc': ('_a', '_b', '_c')}
"""Frame to what follows the name of its currents and voltages."""


def run_plant(plant: Plant, controller: Pid, reference: NDArray[np.float64]) -> Record:
    """Return the record of a motor whose drive is told what the speed controller says.

    Parameters
    ----------
    plant:
        The motor, which begins where it is.
    controller:
        From speed error to what the plant's drive is told.
    reference:
        (N,) speed, rad/s.
    """
    dt, command = 1 / plant.setup.rate, 0.0
    commands, samples = np.zeros(reference.size), []
    for k, wanted in enumerate(reference.tolist()):
        commands[k] = command
        samples.append(plant.sample(command))
        command = controller.step(wanted, samples[-1].speed, dt)
    signals = {'speed_reference': reference, f'{plant.command}_command': commands}
    for kind in ('voltage', 'current'):
        table = np.array([getattr(sample, kind) for sample in samples])
        signals |= {f'{kind}{axis}': table[:, j] for j, axis in enumerate(AXES[plant.frame])}
    signals['speed'] = np.array([sample.speed for sample in samples])
    signals['position'] = np.array([sample.position for sample in samples])
    units = {name: BY_NAME[name].units[0] for name in signals}
    time = dt * np.arange(reference.size, dtype=np.float64)
    return Record(time, signals, units, Provenance('simulated'))
