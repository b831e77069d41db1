"""Motors as their makers describe them, from a 3 W coreless motor to a geared 300 W drive."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DataSheet:
    """What a data sheet says; everything at the shaft that is measured.

    Attributes
    ----------
    name, source:
        Motor, and where the values come from.
    voltage:
        Nominal voltage, V.
    R, L, k, J:
        Ohm, H, N m/A, kg m^2 (rotor, or rotor seen through the gear).
    torque:
        Rated torque, N m.
    load:
        Smallest and largest inertia of a coupled disc or wheel, in units of `J`.
    counts:
        Encoders that may be fitted: counts per turn of the measured shaft.
    rates:
        Sampling rates that its drives have, Hz.
    """

    name: str
    source: str
    voltage: float
    R: float
    L: float
    k: float
    J: float
    torque: float
    load: tuple[float, float] = (0.5, 4.0)
    counts: tuple[int, ...] = (500, 1000, 2000, 2048, 4096)
    rates: tuple[int, ...] = (1000, 1000, 1000, 200)

    @property
    def current(self) -> float:
        """Rated current, A."""
        return self.torque / self.k

    @property
    def top_speed(self) -> float:
        """No-load speed at nominal voltage, rad/s."""
        return self.voltage / self.k


DATA_SHEETS = (
    DataSheet(
        'Faulhaber 1524T012SR', 'Faulhaber data sheet 1524 ... SR: 5 W, coreless',
        12.0, 19.8, 420e-6, 11.5e-3, 0.56e-7, 2.9e-3, (2.0, 8.0),
    ),
    DataSheet(
        'Faulhaber 1331T012SR', 'Faulhaber data sheet 1331 ... SR: 2.6 W, coreless',
        12.0, 13.7, 310e-6, 11.4e-3, 0.67e-7, 3.2e-3, (2.0, 8.0),
    ),
    DataSheet(
        'maxon RE 25 118752', 'maxon catalogue, RE 25, 20 W, graphite brushes, coreless',
        24.0, 2.32, 240e-6, 23.4e-3, 10.8e-7, 28e-3,
    ),
    DataSheet(
        'maxon DCX 22 L 9 V', 'maxon catalogue, DCX 22 L, coreless',
        9.0, 0.168, 18e-6, 6.95e-3, 9.37e-7, 27e-3, (2.0, 8.0),
    ),
    DataSheet(
        'maxon A-max 32 24 V', 'maxon catalogue, A-max 32, 20 W, graphite brushes, coreless',
        24.0, 3.99, 556e-6, 35.2e-3, 45.3e-7, 43e-3,
    ),
    DataSheet(
        'maxon RE 40 148867', 'maxon catalogue, RE 40, 150 W, graphite brushes, coreless',
        24.0, 0.316, 82e-6, 30.2e-3, 138e-7, 177e-3,
    ),
    DataSheet(
        'maxon RE 50 370354', 'maxon catalogue, RE 50, 200 W, graphite brushes, coreless',
        24.0, 0.103, 72e-6, 38.5e-3, 542e-7, 405e-3,
    ),
    DataSheet(
        'Pololu 4753', 'Pololu 37D gearmotor data sheet, 50:1, 12 V: 210 kg mm and 5.5 A '
        'at stall, 200 rpm; inductance and rotor inertia of a 37 mm iron-core motor',
        12.0, 2.18, 1.6e-3, 0.50, 3.6e-3, 0.45, (0.1, 1.5), (3200,), (200,),
    ),
    DataSheet(
        'CIM with 10.71:1 gear', 'VEX data sheet 217-2000: 12 V, 5330 rpm, 131 A and 2.41 N m at '
        'stall, 337 W, iron core',
        12.0, 0.0916, 59e-6, 0.198, 8.6e-3, 4.8, (0.1, 1.5), (4096,), (1000, 200),
    ),
)  # fmt: skip
