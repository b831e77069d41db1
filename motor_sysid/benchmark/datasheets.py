"""Motors as data sheets describe them, from a 0.4 W coreless motor to a 220 W one and to gears.

Every value stands in a source that can be looked up.  What no sheet gives, inertia of a load and
ratio of a gear, is a choice of the benchmark and is drawn or named as such.
"""

from dataclasses import dataclass, replace


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


def geared(
    motor: DataSheet,
    ratio: float,
    load: tuple[float, float],
    counts: tuple[int, ...],
    rates: tuple[int, ...],
) -> DataSheet:
    """Return a motor seen through an ideal gear; its losses are what the benchmark hides."""
    return replace(
        motor,
        name=f'{motor.name} with {ratio:g}:1 gear',
        source=f'{motor.source}; ideal gear, its ratio chosen here',
        k=motor.k * ratio,
        J=motor.J * ratio**2,
        torque=motor.torque * ratio,
        load=load,
        counts=counts,
        rates=rates,
    )


_SR_0816 = 'Faulhaber data sheet, series 0816 ... SR, lines 1, 2, 10, 13, 15, 29'
_SR_1524 = 'Faulhaber data sheet EN_1524_SR_DFF, lines 1, 2, 10, 13, 15, 29'
_SR_1331 = 'Faulhaber data sheet, series 1331 ... SR, lines 1, 2, 11, 14, 16, 28'
_CR_3863 = 'Faulhaber data sheet, series 3863 ... CR, 2012 May 10, lines 1, 2, 11, 14, 16, 28'
_DCX_22 = (
    'maxon DCX 22 L, 9 V winding, as written down in github.com/mattchg/ELEC441 (MotorSpecs.m)'
)
_RE_35 = (
    'maxon RE 35, 30 V winding, as written down in '
    'github.com/MLohoefener/Mechatronische_Systeme_Master (RE_35.m)'
)

_SMALL = (2.0, 8.0)
_LARGE = DataSheet('Faulhaber 3863H024CR', _CR_3863, 24.0, 0.64, 180e-6, 39.8e-3, 120e-7, 157e-3)
_GEARABLE = DataSheet(
    'Faulhaber 1331T012SR', _SR_1331, 12.0, 13.7, 310e-6, 11.4e-3, 0.67e-7, 3.2e-3
)

DATA_SHEETS = (
    DataSheet(
        'Faulhaber 0816K006SR', _SR_0816, 6.0, 21.2, 217e-6, 4.12e-3, 0.052e-7, 0.69e-3, _SMALL
    ),
    DataSheet(
        'Faulhaber 1524T006SR', _SR_1524, 6.0, 5.1, 110e-6, 6.0e-3, 0.58e-7, 2.9e-3, _SMALL
    ),
    DataSheet(
        'Faulhaber 1524T012SR', _SR_1524, 12.0, 19.8, 420e-6, 11.5e-3, 0.56e-7, 2.9e-3, _SMALL
    ),
    replace(_GEARABLE, load=_SMALL),
    DataSheet(
        'Faulhaber 1331T024SR', _SR_1331, 24.0, 52.9, 1100e-6, 21.8e-3, 0.63e-7, 3.2e-3, _SMALL
    ),
    DataSheet(
        'maxon DCX 22 L 9 V', _DCX_22, 9.0, 0.168, 18e-6, 6.95e-3, 9.37e-7, 27e-3, _SMALL
    ),
    DataSheet('maxon RE 35 30 V', _RE_35, 30.0, 1.2, 340e-6, 38.9e-3, 68.1e-7, 97.2e-3),
    DataSheet(
        'Faulhaber 3863H012CR', _CR_3863, 12.0, 0.16, 45e-6, 19.9e-3, 120e-7, 120e-3
    ),
    _LARGE,
    DataSheet(
        'Faulhaber 3863H048CR', _CR_3863, 48.0, 2.58, 700e-6, 79.7e-3, 115e-7, 159e-3
    ),
    geared(_GEARABLE, 43, (0.1, 1.5), (3200,), (200,)),
    geared(_LARGE, 14, (0.1, 1.5), (4096,), (1000, 200)),
)  # fmt: skip
