"""What makes parameters of a motor move, and in which proportion: the table of causes.

A cause moves the logarithms of parameters along one direction, or along any mixture of a few with
positive weights.  Parameters are told by their role, so that one table serves every motor.

Sensors and supply: with the true ``u = R i + L di/dt + k omega`` and
``k i = J domega/dt + b omega + tau``, a current that reads ``g`` times too large gives ``R/g``,
``L/g`` and ``g J``, ``g b``, ``g tau``; a speed ``k/g``, ``J/g^2``, ``b/g^2``, ``tau/g``; a
voltage ``g`` times all of them.

Sources: copper 0.393 %/K at 20 degrees (IEC 60228:2004, annex B); remanence of magnets between
-0.03 (SmCo) and -0.2 %/K (ferrite) (Krishnan, Permanent Magnet Synchronous and Brushless DC Motor
Drives, 2010, section 1.1); faults and their parameters: Isermann, Fault-Diagnosis Applications,
2011, chapter 3 (DC motor).
"""

from collections.abc import Mapping
from dataclasses import dataclass

from motor_sysid.physics.parameters import Parameter

COPPER = 0.00393
"""Rise of copper's resistance per kelvin, of its value at 20 degrees Celsius."""

_R, _L, _K, _J, _B = 'resistance', 'inductance', 'constant', 'inertia', 'viscous friction'
_DRY, _LOAD = 'dry friction', 'load torque'

_ROLES = {
    'R': _R, 'L': _L, 'L_d': _L, 'L_q': _L, 'k_t': _K, 'k_e': _K, 'psi_f': _K, 'J': _J, 'b': _B,
    'constant_load_torque.tau_l': _LOAD, 'gravity_load.tau_sin': _LOAD,
    'gravity_load.tau_cos': _LOAD,
}  # fmt: skip
_FRICTIONS = ('tau_c', 'tau_c_plus', 'tau_c_minus', 'tau_s')


@dataclass(frozen=True)
class Cause:
    """One cause.

    Attributes
    ----------
    words:
        What it is.
    directions:
        What it does: role to relative change, in any unit; mixtures of several directions are
        possible with positive weights.
    check:
        What tells whether it is so.
    warms:
        Whether the change of resistance is one of temperature.
    brushed:
        Whether only motors with brushes have it.
    """

    words: str
    directions: tuple[Mapping[str, float], ...]
    check: str
    warms: bool = False
    brushed: bool = False


CAUSES = (
    Cause('a warmer winding', ({_R: 1.0},), 'record again when it has cooled', warms=True),
    Cause('a colder winding', ({_R: -1.0},), 'record again when it is warm', warms=True),
    Cause(
        'worn brushes or a bad contact', ({_R: 1.0},),
        'measure the resistance from plug to plug at several angles', brushed=True,
    ),
    Cause(
        'a bad contact or a longer cable', ({_R: 1.0},),
        'measure the resistance of each phase at the drive and at the motor',
    ),
    Cause(
        'a motor that is warm throughout', ({_R: 0.393, _K: -0.03}, {_R: 0.393, _K: -0.2}),
        'record again when it has cooled', warms=True,
    ),
    Cause('magnets that are hot or demagnetised', ({_K: -1.0},), 'record again when it is cold'),
    Cause(
        'turns that are shorted', ({_R: -1.0, _L: -2.0, _K: -1.0},),
        'compare resistance and inductance of the phases or segments',
    ),
    Cause(
        'a bearing that wears, or a lubricant that is old or cold', ({_B: 1.0}, {_DRY: 1.0}),
        'turn it by hand, listen, and record again when it has run warm',
    ),
    Cause(
        'a lubricant that is warm, or a bearing that has run in', ({_B: -1.0}, {_DRY: -1.0}),
        'record again when it is cold',
    ),
    Cause('a larger load inertia', ({_J: 1.0},), 'look at what the motor carries'),
    Cause('a smaller load inertia', ({_J: -1.0},), 'look for a loose coupling or a lost tool'),
    Cause('a changed load torque', ({_LOAD: 1.0},), 'look at what pulls at the motor'),
    Cause('a changed load torque', ({_LOAD: -1.0},), 'look at what pulls at the motor'),
    Cause(
        'a current sensor that reads too much',
        ({_R: -1.0, _L: -1.0, _J: 1.0, _B: 1.0, _DRY: 1.0, _LOAD: 1.0},),
        'compare with a clamp meter',
    ),
    Cause(
        'a current sensor that reads too little',
        ({_R: 1.0, _L: 1.0, _J: -1.0, _B: -1.0, _DRY: -1.0, _LOAD: -1.0},),
        'compare with a clamp meter',
    ),
    Cause(
        'a speed that reads too much',
        ({_K: -1.0, _J: -2.0, _B: -2.0, _DRY: -1.0, _LOAD: -1.0},),
        'count turns against the encoder; look at its setting',
    ),
    Cause(
        'a speed that reads too little',
        ({_K: 1.0, _J: 2.0, _B: 2.0, _DRY: 1.0, _LOAD: 1.0},),
        'count turns against the encoder; look at its setting',
    ),
    Cause(
        'a supply that is lower than the recorded voltage says',
        ({_R: 1.0, _L: 1.0, _K: 1.0, _J: 1.0, _B: 1.0, _DRY: 1.0, _LOAD: 1.0},),
        'measure the voltage at the motor',
    ),
    Cause(
        'a supply that is higher than the recorded voltage says',
        ({_R: -1.0, _L: -1.0, _K: -1.0, _J: -1.0, _B: -1.0, _DRY: -1.0, _LOAD: -1.0},),
        'measure the voltage at the motor',
    ),
)  # fmt: skip
"""Every cause that is known.  To add one, write it here."""


def role_of(parameter: Parameter) -> str:
    """Return the role of a parameter in the table; empty if it has none."""
    effect, _, name = parameter.name.rpartition('.')
    if effect.endswith('friction') and name in _FRICTIONS:
        return _DRY
    return _ROLES.get(parameter.name, '')
