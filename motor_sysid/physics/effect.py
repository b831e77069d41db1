"""What an effect is: a card that describes it and one or two laws, all in one small file.

An effect file defines ``CARD`` and at least one law.  A law is a function of one sample; its
argument names say what it needs, and nothing else has to be declared:

* states and inputs of the motor: ``i, omega, theta, u, t`` (and ``i_d, i_q, u_d, u_q, ...``);
  ``t`` is the time since the start of the record, ``turn`` the angle in rad that the shaft turns
  in one step (see `motor_sysid.physics.laws.step_share`),
* of a law that moves a state at once, the angle ``theta_before`` at the beginning of the step that
  ends now, the length of that ``step`` in s, the ``voltage`` that all laws together add now, and
  its ``slope`` by the current,
* the rate of change of the equation that the law is added to: ``domega`` for a torque, ``di`` for
  a voltage; the law must be proportional to it,
* parameters of the motor: ``R, L, k_t, J, b, ...``, and the widths ``omega_eps, i_eps``,
* the effect's own parameters and own states.

``torque(...)`` is added to the torque balance and ``voltage(...)`` to the voltage balance;
``current_sensor(...)`` and ``speed_sensor(...)`` are added to what the sensor shows;
``speed_sum(...)`` is what the sum of the speeds that the sensor shows has beyond the angle of the
shaft, and may ask for that sum, ``summed`` (rad), and the speed that is ``shown``: where no
position is measured, laws that depend on the angle see that sum without it;
``jump_i(...)`` and ``jump_omega(...)`` are added to current and speed at the end of a step (what
happens at once, when the rotor passes an angle, say);
``rate(...)`` gives the time derivative of the effect's own state.  A card with ``delay`` set names
the parameter that delays the input.

An effect serves every motor that has what its laws ask for.  Where a three-phase motor takes
another law, that one bears the motor's frame: ``torque_dq``, ``rate_abc``; voltages have names of
their own, ``voltage_d``, ``voltage_q``, ``voltage_a``, ``voltage_b``.  A part of an equation that
does not go with a rate of change stands in a second law beside the one that does:
``and_voltage_d``.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache
import inspect

ARGUMENTS = (
    'i', 'omega', 'theta', 'u', 't', 'i_d', 'i_q', 'u_d', 'u_q', 'i_a', 'i_b', 'i_c', 'u_a',
    'u_b', 'u_c', 'di', 'domega', 'turn', 'di_d', 'di_q', 'di_a', 'di_b', 'theta_before', 'step',
    'slope', 'summed', 'shown',
)  # fmt: skip
"""Every state, input and rate of change that a law may ask for, in the order of the kernel's
rows."""

FORCES = ('torque', 'voltage', 'voltage_d', 'voltage_q', 'voltage_a', 'voltage_b', 'voltage_c')
"""Every equation that a law may be added to: these are the names of the law functions."""

SPEED_SENSOR = 'speed_sensor'

SENSORS = (
    'current_sensor', SPEED_SENSOR, 'current_d_sensor', 'current_q_sensor', 'current_a_sensor',
    'current_b_sensor',
)  # fmt: skip
"""Every sensor whose reading a law may change; the law's value is added to the signal."""

SUM = 'speed_sum'
"""Name of the law of what the sum of the shown speed has beyond the angle."""

JUMPS = ('jump_i', 'jump_omega')
"""Every state that a law may move at once, at the end of a step, by adding its value."""

SHORTFALLS = (
    'constant_input', 'no_motion', 'one_direction', 'few_speeds', 'mostly_at_rest', 'short_travel',
    'never_slow', 'no_current', 'slow_sampling', 'begins_driven',
)  # fmt: skip
"""Every shortfall of an excitation that may hide an effect."""

SECOND = 'and_'
"""Before the name of a law that is added to an equation beside another one of the same effect."""

FRAMES = ('dq', 'abc')
"""How the currents of a three-phase motor are told: on and across the magnet, or by phase."""

DRIVEN = 'driven'
"""Ending of laws of torque for an axis, where the input is the torque that drives it."""

REDUCED = 'voltage_reduced'
"""Name of a law for motors whose only equation is a balance of voltages."""

FAITHFUL = 0.02
"""No law follows its effect closer than this share of it."""

Law = Callable[..., float]


class Enters(Enum):
    """Where an effect enters, as the diagnosis reports it."""

    MECHANICAL = 'mechanical'
    ELECTRICAL = 'electrical'
    INPUT = 'input'
    SENSOR = 'sensor'


class Scale(Enum):
    """What the size of a parameter is measured by; see `motor_sysid.physics.scales`."""

    ONE = 'one'
    TORQUE = 'torque'
    DRAG = 'torque / speed^2'
    SPEED = 'speed'
    CURRENT = 'current'
    ANGLE = 'speed * sample time'
    VOLTAGE = 'voltage'
    PER_VOLTAGE = '1 / voltage'
    SAG = '1 / (voltage current)'
    SAMPLE = 'sample time'
    RATE = 'samples per second'
    DURATION = 'duration'
    DRIFT = 'torque / duration'
    VISCOUS_DRIFT = 'torque / (speed duration)'
    ROOT_SPEED = 'torque / speed^0.5'
    HEATING = 'duration / loss energy'


@dataclass(frozen=True)
class Amplitude:
    """A parameter that switches its effect off at zero, and in which the law is linear.

    Attributes
    ----------
    name, unit, description:
        Symbol, SI unit for a rotary motor, one sentence.
    scale:
        What its size is measured by.
    limit:
        Largest sensible absolute value, in units of the scale.
    positive:
        Whether physics forbids negative values.
    trials:
        Values to try, in units of the scale, where the law is far from linear in this parameter;
        empty where its derivative at zero tells what it does.
    swings:
        Whether a motor may well be weaker than this: a weight that it cannot hold, it can swing.
    """

    name: str
    unit: str
    description: str
    scale: Scale
    limit: float = 10.0
    positive: bool = False
    trials: tuple[float, ...] = ()
    swings: bool = False


@dataclass(frozen=True)
class Shape:
    """A parameter that shapes the law and has no neutral value.

    Attributes
    ----------
    name, unit, description:
        Symbol, SI unit for a rotary motor, one sentence.
    scale:
        What its size is measured by.
    starts:
        Values to start from, in units of the scale; empty where the data propose them.
    lower, upper:
        Box in units of the scale.
    free:
        Whether a fit may change it; an order (waves per turn) is chosen, not fitted.
    edge:
        Whether it is where one law ends and another begins: beyond the last sample that reaches
        it, data tell nothing of it.
    bends:
        Values, in units of the scale, from which a fit may change it after all, if the law with
        it as it starts, where that is simplest, leaves clearly more.
    """

    name: str
    unit: str
    description: str
    scale: Scale
    starts: tuple[float, ...]
    lower: float
    upper: float
    free: bool = True
    edge: bool = False
    bends: tuple[float, ...] = ()


@dataclass(frozen=True)
class Card:
    """What people read about an effect, and what the diagnosis needs to know of it.

    Attributes
    ----------
    title, equation, symptom, reference:
        Name, law as text, what one sees in the data when it is missing, and the source.
    enters:
        Which part of the model it belongs to.
    amplitudes, shapes:
        Its parameters.
    axis:
        What its evidence is plotted against: speed, position, current or time.
    states:
        Names of its own states, zero at the start of a record unless `begins` says otherwise.
    begins:
        Own state to the state of the motor whose value it has at the start of a record.
    delay:
        Name of the parameter that delays the input, if the effect is one.
    generalises:
        Effects that are special cases of this one: key to (own parameter, parameter of the
        special case that it starts from) pairs.  It takes the place of what it `replaces` of them.
    sum_of:
        Effects whose laws together are this one's law under other parameters: no record tells
        them apart.
    rotary:
        Whether it needs an angle, and so makes no sense for a linear axis.
    shrinks:
        Motor parameters, those of every kind, that hold the effect's share while the model lacks
        it; they are divided by one plus its first amplitude when it is added.
    slows:
        Motor parameters that likewise hold its share of the friction, each with the shape that is
        that share's rate, 1/s: friction over inertia.
    drains:
        Amplitude, per second, to the parameters (of motors of every kind, of other effects) whose
        sum it must not use up within a record: friction would feed energy.
    settles:
        Name of the shape that is the time constant (s) with which that comes to an end.
    orders:
        Name of the shape that counts waves per turn, if the data are to be searched for it.
    carrier:
        State that multiplies the waves per turn.
    moment, frequency:
        Name of the shape that is a time (s) or a frequency (Hz), if the data are to be searched
        for it.
    repeats:
        How many times a model may hold it, each time with shapes of its own.
    filter:
        Name of the amplitude that is the time constant (s) of a filter of first order whose output
        is its own state and all that the sensor shows.  What is differenced from sample to sample
        passes it in the same way.
    covers:
        Motor parameter that does the same; where a fit may change that, nothing is missing.
    linear:
        Whether all laws and rates are linear in states and inputs: then they are solved exactly,
        together with the linear motor.
    pace:
        Name of the shape that is the rate (rad/s) at which its own states swing, if they are not
        solved exactly: the steps of the integration follow it.
    strikes:
        Whether its own states strike something: each blow depends on the last one, so that outputs
        are smooth functions of any parameter only over a hundredth of it.
    grids:
        Parameter to finite values, in units of its scale, of all combinations of which the best
        are tried as starts; for an effect of whose strength a touch tells little.  Values of what
        `slows` are shares of the motor's friction.
    inherent:
        Largest usual value of the first amplitude (SI), for what every motor has: up to it, it
        goes first among what explains as well, beyond it last; 0 for any other effect.
    misfit:
        Share of the effect that its law may miss in a real motor; what is left then looks like
        another function of the same thing.  More where the form of the law is a habit.
    hidden_by:
        Shortfalls of the excitation, of `SHORTFALLS`, for which it cannot be seen or told from
        others.
    """

    title: str
    equation: str
    symptom: str
    reference: str
    enters: Enters
    amplitudes: tuple[Amplitude, ...]
    shapes: tuple[Shape, ...] = ()
    axis: str = 'speed'
    states: tuple[str, ...] = ()
    begins: Mapping[str, str] = field(default_factory=dict)
    delay: str = ''
    generalises: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    sum_of: tuple[str, ...] = ()
    rotary: bool = False
    shrinks: tuple[str, ...] = ()
    slows: Mapping[str, str] = field(default_factory=dict)
    drains: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    settles: str = ''
    orders: str = ''
    carrier: str = ''
    moment: str = ''
    frequency: str = ''
    repeats: int = 1
    filter: str = ''
    covers: str = ''
    linear: bool = False
    pace: str = ''
    strikes: bool = False
    grids: tuple[Mapping[str, tuple[float, ...]], ...] = ()
    inherent: float = 0.0
    misfit: float = FAITHFUL
    hidden_by: tuple[str, ...] = ()

    @property
    def parameters(self) -> tuple[Amplitude | Shape, ...]:
        """Amplitudes, then shapes."""
        return (*self.amplitudes, *self.shapes)

    @property
    def replaces(self) -> Mapping[str, tuple[tuple[str, str], ...]]:
        """Special cases that leave no room for themselves beside this effect, as `generalises`.

        What sets in at some moment adds to what is there from the start.
        """
        return {} if self.moment else self.generalises


@dataclass(frozen=True)
class Effect:
    """A loaded effect: key, card, laws, and the source text that they are compiled from.

    Attributes
    ----------
    laws:
        Name of the equation to its law.
    rates:
        Own state to its rate law.
    after:
        Key of the effect that a model must have before this one is looked for, or empty.
    speed_sum:
        What the sum of the shown speed has beyond the angle, rad, for one that changes the speed
        sensor; None where that is nothing.
    starts:
        Own state to where it begins in motion, from what is read there of the motor: states, their
        rates (`d` before the name, per s) and parameters; zero where nothing moves.
    doubts:
        State of the motor to how far it may be from what is read there (standard deviation), for
        an own state that may begin elsewhere; of the same arguments.
    """

    key: str
    card: Card
    laws: dict[str, Law]
    rates: dict[str, Law]
    source: str
    after: str = ''
    speed_sum: Law | None = None
    starts: dict[str, Law] = field(default_factory=dict)
    doubts: dict[str, Law] = field(default_factory=dict)

    @property
    def filters_speed(self) -> bool:
        """Whether it is a filter that the speed passes before it is shown."""
        return bool(self.card.filter) and SPEED_SENSOR in self.laws

    def repeated(self) -> 'tuple[Effect, ...]':
        """Return the effect, and beside it each further time that a model may hold it."""
        found = [self]
        for number in range(2, self.card.repeats + 1):
            card = replace(self.card, title=f'{self.card.title}, set {number}')
            key = f'{self.key}_{number}'
            found.append(replace(self, key=key, card=card, after=found[-1].key))
        return tuple(found)

    def within(self, frame: str, targets: Iterable[str], balance: str = '') -> 'Effect':
        """Return the effect with the laws that a motor of that frame and those equations takes.

        Parameters
        ----------
        frame:
            One of `FRAMES`, `DRIVEN`, or empty for a motor with one current.
        targets:
            Names of the motor's equations and sensors.
        balance:
            Equation of a motor whose only balance is one of voltages, or empty: it takes the law
            made for such a motor, or a law of voltage if the effect has none for it.
        """
        named = [name for target in targets for name in (target, SECOND + target)]
        laws = {name: law for name in named if (law := _of_frame(self.laws, name, frame))}
        if balance and (REDUCED in self.laws or balance not in laws):
            standing = self.laws.get(REDUCED) or self.laws.get('voltage')
            laws |= {balance: standing} if standing else {}
        rates = {
            state: law
            for state in self.card.states
            if (law := _of_frame(self.rates, state, frame))
        }
        summed = self.speed_sum if SPEED_SENSOR in laws else None
        return replace(self, laws=laws, rates=rates, speed_sum=summed)

    def needs(self) -> set[str]:
        """Return the states, inputs and motor parameters that the laws ask for."""
        own = {p.name for p in self.card.parameters} | set(self.card.states)
        asked: set[str] = set()
        for law in (*self.laws.values(), *self.rates.values()):
            asked |= set(arguments(law))
        return asked - own


@cache
def arguments(law: Law) -> tuple[str, ...]:
    """Return what a law asks for, in the order of its arguments."""
    return tuple(inspect.signature(law).parameters)


def _of_frame(laws: Mapping[str, Law], name: str, frame: str) -> Law | None:
    return laws.get(f'{name}_{frame}') or laws.get(name)
