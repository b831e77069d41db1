"""What a motor kind is: its states, channels, parameters, linear core, and laws beyond that."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.effect import arguments, DRIVEN, Effect, JUMPS, Law
from motor_sysid.physics.parameters import Parameter, ParameterSet
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Values = Mapping[str, Array]
Matrices = tuple[Array, Array, Array]
Columns = Callable[[Record, int], tuple[Array, Array]]

CUTS = (50, 100, 200, 400, 800)
"""Windows of a record over which balances are integrated, fewest first."""

MOST_SUBSTEPS = 64


@dataclass(frozen=True)
class Output:
    """A signal that the motor kind can predict.

    Attributes
    ----------
    signal:
        Canonical name of the signal.
    state:
        State that it shows.
    bias:
        Motor parameter that is added by the sensor, or empty.
    """

    signal: str
    state: str
    bias: str = ''


@dataclass(frozen=True)
class Force:
    """An equation that effects may add to.

    Attributes
    ----------
    name:
        Name of the laws that enter here: torque, voltage, ...
    own_state:
        The state in which such laws may be stiff.
    unit:
        Unit of the law's value.
    """

    name: str
    own_state: str
    unit: str


@dataclass(frozen=True)
class Term:
    """``factors * parameter * product of signals``, or its time derivative.

    Attributes
    ----------
    parameter:
        Motor parameter in which the term is linear, or empty.
    signals:
        States, inputs (as laws name them) and `Motor.derived` signals that are multiplied.
    factors:
        Motor parameters that are held and multiply.
    derivative:
        Whether the time derivative of the signal is meant.
    sign:
        1 or -1.
    """

    parameter: str
    signals: tuple[str, ...]
    factors: tuple[str, ...] = ()
    derivative: bool = False
    sign: float = 1.0


@dataclass(frozen=True)
class Balance:
    """One equation of a motor: ``drive + laws = sum of terms``, linear in its parameters.

    Attributes
    ----------
    force:
        Name of the laws that enter here.
    drive, terms:
        Its two sides; the parameter of the drive, if any, belongs to another balance or is held.
    given:
        Terms of the side of `terms` whose parameters other balances find.
    """

    force: str
    drive: Term
    terms: tuple[Term, ...]
    given: tuple[Term, ...] = ()


@dataclass(frozen=True)
class Motor:
    """A motor kind; one file of this folder each.

    Attributes
    ----------
    key, title:
        Name in files and on the command line; name for people.
    states:
        Core states, named as laws name them.
    inputs:
        Sets of input signals that can drive it, the preferred first; each set lists the signals
        in the order of the columns of ``B``.
    arguments:
        Names under which laws see the inputs, in the same order.
    outputs:
        Signals that it predicts.
    forces:
        Equations that effects may add to, in the order of the columns of ``G``.
    parameters:
        Its parameters with boxes and default values.
    matrices:
        ``values -> (A (P, n, n), B (P, n, n_u), G (P, n, m))`` for arrays of P values each: the
        linear core, which is simulated exactly.
    start:
        ``records, given -> values``: start values read from the records without iteration, with
        what the user gives (pole pairs, say).
    balances:
        Its equations in a form that is linear in the parameters, for recursive regression.
    drive_torque:
        ``(values, record) -> (N,)`` torque that the motor puts on its shaft, as measured.
    frame:
        Frame of a three-phase motor, see `motor_sysid.physics.effect.FRAMES`; empty otherwise.
    driven:
        Whether its input is the torque that drives it: it takes laws that are made for that.
    own:
        Laws of the motor itself that its linear core does not hold, as an effect without
        parameters of its own; it is always there.
    derived:
        Signals for the balances: name to a law of states, inputs and held parameters.
    typical:
        As `matrices`, for a linear motor that behaves much like it: what sizes and time constants
        are taken from.  By default the core itself.
    shown:
        Parameters that only its sensors' own laws read, and linearly: offsets.
    unless_given:
        Held parameters that are fitted where no data sheet tells them.
    prompt:
        Whether its outputs follow the input at once: what acts over a sample is then the input at
        its end.
    foreign:
        Effects that it cannot have, though its equations would take them.
    wave:
        Parameter that counts the electrical turns in one turn of the shaft, or empty.
    longest_turn:
        Electrical angle in rad that it may turn in one step of integration.
    balance:
        Its only equation, where that is a balance of voltages under another name, or empty.
    unmeasured:
        Kind that takes its place where its currents were not all recorded, or empty.
    blurred:
        Kind that takes its place where its field turns by more than a turn from sample to sample,
        or empty.
    terminals:
        Whether its resistance and inductance are those between two terminals of three.
    tells:
        Signals that tell of this kind: where all were recorded, it is taken unless another one is
        asked for.
    prepare:
        ``records, known -> records`` with what this kind needs beside the signals of a record.
    remark:
        ``parameters -> words`` on what fitted ones say of the drive, and what to do; or nothing.
    """

    key: str
    title: str
    states: tuple[str, ...]
    inputs: tuple[tuple[str, ...], ...]
    arguments: tuple[str, ...]
    outputs: tuple[Output, ...]
    forces: tuple[Force, ...]
    parameters: tuple[Parameter, ...]
    balances: tuple[Balance, ...]
    matrices: Callable[[Values], Matrices]
    start: Callable[[Sequence[Record], Mapping[str, float]], dict[str, float]]
    drive_torque: Callable[[Mapping[str, float], Record], Array]
    frame: str = ''
    driven: bool = False
    own: Effect | None = None
    derived: Mapping[str, Law] = field(default_factory=dict)
    typical: Callable[[Values], Matrices] | None = None
    shown: tuple[str, ...] = ()
    unless_given: tuple[str, ...] = ()
    wave: str = ''
    longest_turn: float = 0.35
    prompt: bool = False
    foreign: tuple[str, ...] = ()
    balance: str = ''
    unmeasured: str = ''
    blurred: str = ''
    terminals: bool = False
    tells: tuple[str, ...] = ()
    prepare: Callable[[Sequence[Record], Mapping[str, float]], list[Record]] | None = None
    remark: Callable[[ParameterSet], str] | None = None

    def names(self) -> set[str]:
        """Return everything that a law may ask this motor for."""
        rates = {f'd{force.own_state}' for force in self.forces}
        own = {*self.states, *self.arguments, *(p.name for p in self.parameters)}
        return own | rates | {'t', 'turn', 'theta_before', 'step', 'slope', 'voltage'}

    def taking(self, one: Effect) -> Effect:
        """Return an effect with those of its laws that this motor takes.

        A law for the sensor of the current is that of whatever signal shows the current ``i``.
        """
        sensors = [f'{output.signal}_sensor' for output in self.outputs]
        law, states = one.laws.get('current_sensor'), [output.state for output in self.outputs]
        if law is not None and 'i' in states:
            one = replace(one, laws={**one.laws, sensors[states.index('i')]: law})
        equations = [force.name for force in self.forces]
        jumps = [f'jump_{state}' for state in self.states]
        frame = DRIVEN if self.driven else self.frame
        return one.within(frame, (*equations, *sensors, *jumps), self.balance)

    def with_derived(
        self, signals: Mapping[str, Array], values: Mapping[str, float]
    ) -> dict[str, Array]:
        """Return signals (N,) and, beside them, those that follow from them.

        `values` are the motor's parameters.
        """
        found = dict(signals)
        for name, law in self.derived.items():
            asked = arguments(law)
            if all(n in signals or n in values for n in asked):
                found[name] = law(*[signals[n] if n in signals else values[n] for n in asked])  # type: ignore[assignment]
        return found

    @property
    def needs_position(self) -> bool:
        """Whether its equations depend on the angle of the shaft."""
        own = self.own.laws if self.own else {}
        laws = [law for name, law in own.items() if not name.endswith('_sensor')]
        return any('theta' in arguments(law) for law in laws)

    @property
    def jumps(self) -> bool:
        """Whether something moves its states at once, so that its balances do not always hold."""
        return any(name in JUMPS for name in (self.own.laws if self.own else ()))

    @property
    def currents(self) -> tuple[str, ...]:
        """States that are currents."""
        return tuple(name for name in self.states if name == 'i' or name.startswith('i_'))

    @property
    def driving(self) -> frozenset[str]:
        """Signals that may be among its inputs."""
        return frozenset(name for names in self.inputs for name in names)

    def like(self, values: Values) -> Matrices:
        """Return A, B, G of a linear motor that behaves much like this one."""
        return (self.typical or self.matrices)(values)

    def substeps(self, values: Mapping[str, float], speed: float, dt: float) -> int:
        """Return how many steps of integration a sample of `dt` s takes at a speed in rad/s.

        The laws of a three-phase motor turn with its electrical angle.
        """
        turned = values[self.wave] * abs(speed) * dt / self.longest_turn if self.wave else 0.0
        return max(min(math.ceil(turned), MOST_SUBSTEPS), 1) if turned > 1.0 else 1


def stack(rows: Sequence[Sequence[Array]]) -> Array:
    """Return (P, n, k) from n rows of k arrays (P,)."""
    size = max(np.size(value) for row in rows for value in row)
    out = np.empty((size, len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            out[:, i, j] = value
    return out


def integral_regression(records: Sequence[Record], columns: Columns, cut: int = 50) -> Array:
    """Solve ``y = X p`` stacked over records by scaled least squares.

    `columns` gives, for a record and a window in samples, the regressors X (K, p) and y (K,) of
    equations integrated over windows of that length: integration needs no derivative and averages
    the noise.  A record has `cut` windows; each is between 4 and 400 samples.
    """
    parts = [columns(r, _window(r, cut)) for r in records]
    x = np.concatenate([p[0] for p in parts])
    y = np.concatenate([p[1] for p in parts])
    scale = np.linalg.norm(x, axis=0)
    scale[scale == 0] = 1.0
    solution: Array = np.linalg.lstsq(x / scale, y, rcond=1e-10)[0] / scale
    return solution


def inertia_and_friction(records: Sequence[Record], columns: Columns) -> tuple[float, float]:
    """Read J (kg m^2, at least 1e-9) and b (N m s/rad) from a torque balance.

    Its regressors, see `integral_regression`, are the speed gained, the angle, and the time.
    Over windows that are longer than J/b the inertia does little, and a load that pulls back, as
    gravity does, passes for a negative one.  So windows get shorter until they are within it.
    """
    found = []
    for cut in CUTS:
        inertia, b, _ = integral_regression(records, columns, cut)
        found.append((max(float(inertia), 1e-9), float(b)))
        longest = max(_window(record, cut) * record.dt for record in records)
        if 0.0 < inertia >= b * longest:
            return found[-1]
    return found[0]


def _window(record: Record, cut: int) -> int:
    return int(np.clip(len(record) // cut, 4, 400))


def windows(values: Array, length: int) -> tuple[Array, Array]:
    """Return (integral in sample units, increment) over windows that overlap by three quarters."""
    starts = np.arange(0, values.size - length, max(length // 4, 1))
    area = np.concatenate(([0.0], np.cumsum(values)))
    return area[starts + length] - area[starts], values[starts + length] - values[starts]


def areas(values: Array, length: int, dt: float) -> Array:
    """Return integrals over the windows of `windows`, by the trapezoid of what changes fast."""
    area, increment = windows(values, length)
    whole: Array = (area + 0.5 * increment) * dt
    return whole


def paced(now: int, wanted: int) -> int:
    """Return how many substeps to go on with: a power of two, fewer only where a quarter will do.

    Matrices belong to a number of substeps, so it should seldom change from sample to sample.
    """
    return now if now // 4 < wanted <= now else 2 ** math.ceil(math.log2(wanted))
