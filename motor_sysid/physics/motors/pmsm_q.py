"""Permanent magnet synchronous motor of which the q axis alone is recorded.

    L di_q/dt   = u_q - R i_q - k_e omega + voltage effects
    J domega/dt = k_t i_q - b omega + torque effects
    dtheta/dt   = omega

This is the motor with its d current held at zero by the drive: a brushed DC motor in equation,
but for three phases.  With amplitudes of a phase ``k_e = pole_pairs psi_f`` and
``k_t = 1.5 pole_pairs psi_f``: the ratio of the two is 2/3, and no pole pairs need be known.  It
has no brushes, and its drive does not let go between pulses.
(Krishnan, Electric Motor Drives, 2001, chapter 9.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from motor_sysid.physics.motors import brushed_dc
from motor_sysid.physics.motors.base import Array, Output
from motor_sysid.signals.record import Record

EMF_RATIO = 2.0 / 3.0
"""Back-EMF of a phase over torque, both per pole pair and flux: three phases make the torque."""


def start(records: Sequence[Record], given: Mapping[str, float]) -> dict[str, float]:
    """Read the parameters from voltage and torque balances integrated over windows.

    Torque is larger than that of a brushed motor with the same back-EMF by the inverse of
    `EMF_RATIO`, and so are inertia and friction.
    """
    found = brushed_dc.start([_as_dc(record) for record in records], given)
    larger = {name: found[name] / EMF_RATIO for name in ('k_t', 'J', 'b')}
    return {**found, **larger}


def _as_dc(record: Record) -> Record:
    named = record.with_signal('voltage', record['voltage_q'], 'V')
    return named.with_signal('current', record['current_q'], 'A')


def drive_torque(values: Mapping[str, float], record: Record) -> Array:
    """Return k_t i_q, (N,) in N m."""
    torque: Array = values['k_t'] * record['current_q']
    return torque


_DC = brushed_dc.MOTOR
_TOLD = {
    'R': 'resistance of a phase',
    'L': 'inductance across the magnet',
    'k_t': 'torque constant, 1.5 pole_pairs psi_f',
}

MOTOR = replace(
    _DC,
    key='pmsm_q',
    title='permanent magnet synchronous motor, q axis alone',
    inputs=(('voltage_q',),),
    outputs=(Output('current_q', 'i', 'current_offset'), *_DC.outputs[1:]),
    parameters=tuple(
        replace(p, value=EMF_RATIO) if p.name == 'emf_ratio'
        else replace(p, description=_TOLD.get(p.name, p.description))
        for p in _DC.parameters
    ),
    start=start,
    drive_torque=drive_torque,
    foreign=('brush_voltage_drop', 'drive_coast'),
)  # fmt: skip
