"""Parameters of the simulated motor."""

from dataclasses import dataclass

from motor_sysid.errors import UserError
from motor_sysid.nodes.hidden import parse_assignments, scales_of_drive, with_hidden
from motor_sysid.nodes.own_effects import add_effect_files
from motor_sysid.nodes.parameters import parameter
from motor_sysid.nodes.plants.base import Setup
from motor_sysid.nodes.sensors import SensorSettings
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor

PARAMETERS = {
    'brushed_dc': ('R', 'L', 'k_t', 'J', 'b'),
    'pmsm': ('R', 'L_d', 'L_q', 'psi_f', 'J', 'b', 'pole_pairs', 'angle_offset'),
    'bldc': ('R', 'L', 'k_e', 'J', 'b', 'pole_pairs', 'angle_offset'),
}
"""Motor kinds that can be simulated live, and the parameters that each of them takes."""


@dataclass(frozen=True)
class MotorSettings:
    """Parameters of the node."""

    motor_kind: str = parameter(
        'brushed_dc', 'What turns: brushed_dc on a voltage; pmsm under field-oriented control, or '
        'bldc in six steps, on a current that is commanded.', choices=tuple(PARAMETERS),
    )  # fmt: skip
    rate: float = parameter(500.0, 'Samples per second; every one is published.', 'Hz', 10, 2000)
    control_rate: float = parameter(
        0.0, 'Periods per second of the inner loop of pmsm and bldc, a multiple of the rate; 0 '
        'for one in a sample.', 'Hz', 0, 20_000,
    )  # fmt: skip
    R: float = parameter(2.0, 'Resistance of armature or phase.', 'ohm', 1e-3, 1e3)
    L: float = parameter(5e-3, 'Inductance of armature (brushed_dc) or phase (bldc).', 'H', 1e-6,
                         10)  # fmt: skip
    L_d: float = parameter(4e-3, 'Inductance on the magnet (pmsm).', 'H', 1e-6, 10)
    L_q: float = parameter(5e-3, 'Inductance across the magnet (pmsm).', 'H', 1e-6, 10)
    k_t: float = parameter(
        0.05, 'Torque and back-EMF constant (brushed_dc).', 'N m/A', 1e-5, 100
    )
    psi_f: float = parameter(8.3e-3, 'Flux linkage of the magnet (pmsm).', 'V s', 1e-6, 100)
    k_e: float = parameter(
        0.025, 'Flat top of the back-EMF of a phase (bldc).', 'V s/rad', 1e-5, 100
    )
    pole_pairs: int = parameter(4, 'Electrical turns in a turn (pmsm, bldc).', '', 1, 60)
    angle_offset: float = parameter(
        0.0, 'Electrical angle where the position is zero (pmsm, bldc).', 'rad', -7, 7
    )
    J: float = parameter(5e-5, 'Inertia of rotor and load.', 'kg m^2', 1e-9, 100)
    b: float = parameter(2e-5, 'Viscous friction.', 'N m s/rad', 1e-12, 100)
    effect_files: tuple[str, ...] = parameter(
        (), 'Python files with effects of your own (docs/effects.md); each key is the name of its '
        'file.',
    )  # fmt: skip
    hidden_effects: tuple[str, ...] = parameter(
        (), 'Effects that the motor has and its model lacks, by key.', live=True
    )
    hidden_parameters: tuple[str, ...] = parameter(
        (), 'Their parameters as effect.parameter=value in SI; others get a plausible size.',
        live=True,
    )  # fmt: skip
    supply_voltage: float = parameter(
        24.0, 'The drive applies at most this, either way.', 'V', 0.1, 1000
    )
    current_limit: float = parameter(
        5.0, 'The drive of pmsm and bldc follows no larger current.', 'A', 0.01, 1000
    )
    command_timeout: float = parameter(
        0.25, 'The command counts as 0 if none came for so long.', 's', 0.01, 10, live=True
    )
    encoder_counts: int = parameter(4096, 'Counts per turn; 0 for an ideal one.', '', 0, 10**8)
    current_noise: float = parameter(
        0.01, 'Standard deviation of the current sensors.', 'A', 0, 100
    )
    current_offset: float = parameter(
        0.03, 'Offset of the current sensor; of phases that in a, and less that in b.', 'A', -100,
        100,
    )  # fmt: skip
    current_range: float = parameter(
        20.0, 'The current converter covers plus and minus this.', 'A', 0.01, 1e4
    )
    current_bits: int = parameter(12, 'Bits of the current converter; 0 for ideal.', '', 0, 24)
    seed: int = parameter(0, 'Seed of the sensor noise.', '', 0, 2**31 - 1)
    substeps: int = parameter(
        20, 'Integration steps per sample; pmsm and bldc take at least what their angle asks for.',
        '', 1, 1000,
    )  # fmt: skip
    joint_name: str = parameter('motor', 'Name of the joint in motor/speed.')

    @property
    def periods(self) -> int:
        """Control periods in a sample."""
        return max(round(self.control_rate / self.rate), 1)

    @property
    def limit(self) -> float:
        """Largest command: V for a motor on a voltage, A for a drive that follows a current."""
        return self.current_limit if motor(self.motor_kind).frame else self.supply_voltage

    def base(self) -> Model:
        """Return the motor as its maker describes it, and as its drive knows it."""
        values = {name: float(getattr(self, name)) for name in PARAMETERS[self.motor_kind]}
        return Model.base(self.motor_kind, values)

    def model(self) -> Model:
        """Return the plant with its hidden effects."""
        add_effect_files(self.effect_files)
        base = self.base()
        scales = scales_of_drive(base, self.supply_voltage, 1 / self.rate)
        given = parse_assignments(self.hidden_parameters)
        return with_hidden(base, self.hidden_effects, given, scales)

    def setup(self) -> Setup:
        """Return what is simulated."""
        sensors = SensorSettings(
            self.encoder_counts, self.current_noise, self.current_offset, self.current_range,
            self.current_bits, self.seed,
        )  # fmt: skip
        return Setup(
            self.base(), self.model(), sensors, self.rate, self.periods, self.substeps,
            self.supply_voltage, self.current_limit,
        )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse hidden effects that cannot be added, and rates that do not go together."""
        ratio = self.control_rate / self.rate
        if abs(ratio - round(ratio)) > 1e-6:
            raise UserError(
                f'`control_rate` = {self.control_rate:g} Hz is not a multiple of `rate` = '
                f'{self.rate:g} Hz; take {self.periods * self.rate:g} Hz'
            )
        self.model()
