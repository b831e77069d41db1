"""The motors of the demo: what their data sheets say, what is hidden, how they are driven."""

from collections.abc import Mapping
from dataclasses import dataclass

from motor_sysid.control.pid import PidGains
from motor_sysid.control.tuning import current_pi, speed_pi, torque_constant
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor as find_motor

CLOSED_LOOP_TIME = 0.025
"""Time constant of a speed loop that commands a voltage, s."""

CROSSOVER = 25.0
"""Bandwidth of one that commands a current, rad/s: no back-EMF damps it when they come late."""


@dataclass(frozen=True)
class DemoMotor:
    """A motor of the demo.

    Attributes
    ----------
    kind:
        Motor kind.
    datasheet:
        What the user would know of it.
    exact:
        Those of the values that the real motor has exactly.
    hidden:
        Effects that it has besides, unless others are asked for.
    top_speed:
        Of the profile, rad/s.
    rate:
        Samples per second, and control periods of its drive.
    """

    kind: str
    datasheet: Mapping[str, float]
    exact: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ('coulomb_friction', 'cogging_torque')
    top_speed: float = 200.0
    rate: float = 500.0
    supply: float = 24.0
    current_limit: float = 5.0

    @property
    def command(self) -> str:
        """What the speed controller commands."""
        return 'current' if find_motor(self.kind).frame else 'voltage'

    def model(self) -> Model:
        """Return the model from the data sheet."""
        return Model.base(self.kind, self.datasheet, speed_sensor=SpeedSensor.DIFFERENCE)

    def gains(self) -> PidGains:
        """Return the gains of the speed controller, from the data sheet."""
        model = self.model()
        if self.command == 'voltage':
            return speed_pi(model, CLOSED_LOOP_TIME, self.supply)
        torque = torque_constant(model)
        return current_pi(model['J'], torque, CROSSOVER, self.current_limit)


MOTORS = {
    motor.kind: motor
    for motor in (
        DemoMotor('brushed_dc', {'R': 2.0, 'L': 5e-3, 'k_t': 0.05, 'J': 5e-5, 'b': 2e-5}),
        DemoMotor(
            'pmsm',
            {'R': 2.0, 'L_d': 4e-3, 'L_q': 5e-3, 'psi_f': 8.3e-3, 'J': 5e-5, 'b': 2e-5,
             'pole_pairs': 4},
            exact=('pole_pairs',), top_speed=150.0, rate=1000.0,
        ),
        DemoMotor(
            'bldc',
            {'R': 2.0, 'L': 5e-3, 'k_e': 0.025, 'J': 5e-5, 'b': 2e-5, 'pole_pairs': 4},
            exact=('pole_pairs',), top_speed=50.0, rate=1000.0,
        ),
    )
}  # fmt: skip
"""Small 24 V drives with a disc on the shaft, by motor kind: the same torque per ampere."""
