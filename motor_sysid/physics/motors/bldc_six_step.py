"""Brushless motor on a six-step drive, seen between the two phases that drive.

    L di/dt     = u - R i - k_e omega + voltage effects,   i -> i/2 at each commutation
    J domega/dt = k_t i - b omega + torque effects
    dtheta/dt   = omega

``u`` is the duty times the supply across the two phases, ``i`` half the difference of their
currents, both positive for forward torque; R, L and ``k_t`` are those between two terminals (twice
a phase).  The back-EMF between the two is flat in the middle of its trapezoid, so that this is a
DC motor but for what happens at the six commutations in an electrical turn: see
`bldc_six_step_laws`.  A sector begins wherever ``pole_pairs theta + angle_offset`` passes 30
degrees and every 60 on.
(Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, 2010, chapter 11.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from motor_sysid.physics.effect_file import load_effect
from motor_sysid.physics.motors import bldc_six_step_laws, brushed_dc
from motor_sysid.physics.motors.base import Array, integral_regression, windows
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.physics.parameters import Parameter
from motor_sysid.signals.hall import angle_offset_of, pole_pairs_of, within_sectors
from motor_sysid.signals.record import Record

_LEAST_SUPPLY = 1e-3


def start(records: Sequence[Record], given: Mapping[str, float]) -> dict[str, float]:
    """Read the parameters from voltage and torque balances integrated over windows.

    Each commutation takes half of ``L i`` out of the voltage balance.

    Raises
    ------
    UserError
        If the pole pairs are neither given nor to be told from the Hall sectors.
    """
    pairs = given.get('pole_pairs') or pole_pairs_of(records)
    offset = given['angle_offset'] if 'angle_offset' in given else angle_offset_of(records, pairs)

    def electrical(record: Record, length: int) -> tuple[Array, Array]:
        dt, current = record.dt, record['current']
        drive = windows(record['voltage'], length)[0] * dt
        charge, rise = windows(current, length)
        angle = windows(measured_speed(record), length)[0] * dt
        at = record['position']
        place: Array = bldc_six_step_laws.sectors(at, pairs, offset)  # type: ignore[arg-type, assignment]
        steps = np.abs(np.diff(np.floor(place), prepend=np.floor(place[0])))
        # a sample behind an edge shows what is left: as much as was lost
        lost = windows(steps * current, length)[0]
        bias = np.full_like(drive, dt * length)
        return np.column_stack([charge * dt, rise + lost, angle, bias]), drive

    r, inductance, k_e, _ = integral_regression(records, electrical)
    dc = brushed_dc.start(records, given)
    larger = max(k_e, 1e-6) / dc['k_t']
    supply = max(float(np.max(np.abs(record['voltage']))) for record in records)
    r = max(r, 1e-4)
    return {
        **{name: dc[name] * larger for name in ('k_t', 'J', 'b')},
        'R': r,
        'L': float(np.clip(inductance, 0.05 * r * records[0].dt, 50 * r * records[0].dt)),
        'pole_pairs': pairs,
        'angle_offset': offset,
        'v_free': max(given.get('v_free', supply), _LEAST_SUPPLY),
    }


def prepare(records: Sequence[Record], known: Mapping[str, float]) -> list[Record]:
    """Return records whose positions agree with their Hall sectors, where they have both.

    An encoder's count may lie on the other side of an edge that the drive has seen passed: the
    current would halve a sample early or late.
    """
    pairs = known.get('pole_pairs') or pole_pairs_of(records)
    offset = known['angle_offset'] if 'angle_offset' in known else angle_offset_of(records, pairs)
    return [within_sectors(record, pairs, offset) for record in records]


_DC = brushed_dc.MOTOR
_TOLD = {
    'R': 'resistance between two terminals',
    'L': 'inductance between two terminals',
    'k_t': 'torque constant, and back-EMF constant between two terminals',
}

MOTOR = replace(
    _DC,
    key='bldc_six_step',
    title='brushless motor on a six-step drive',
    parameters=(
        *(replace(p, description=_TOLD.get(p.name, p.description)) for p in _DC.parameters),
        Parameter('current_offset_a', 'A', 0.0, -100.0, 100.0,
                  'offset of the sensor in phase a beyond that in phase c'),
        Parameter('current_offset_b', 'A', 0.0, -100.0, 100.0,
                  'offset of the sensor in phase b beyond that in phase c'),
        Parameter('pole_pairs', '1', 4.0, 1.0, 64.0, 'electrical turns in one turn', free=False),
        Parameter('angle_offset', 'rad', 0.0, -7.0, 7.0, 'electrical angle at position zero',
                  free=False),
        Parameter('v_free', 'V', 24.0, _LEAST_SUPPLY, 1e4,
                  'supply against which a phase that is switched off frees itself', free=False),
    ),
    start=start,
    own=load_effect('bldc_six_step', bldc_six_step_laws),
    shown=('current_offset_a', 'current_offset_b'),
    unless_given=('v_free',),
    wave='pole_pairs',
    longest_turn=0.9,
    foreign=('brush_voltage_drop',),
    terminals=True,
    unmeasured='',
    tells=('voltage', 'current', 'position', 'hall_sector'),
    prepare=prepare,
)  # fmt: skip
