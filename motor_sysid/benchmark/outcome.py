"""One line of the benchmark: what was hidden, what was said, and how far off the numbers are."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from enum import Enum


class Outcome(Enum):
    """What became of a case."""

    RIGHT = 'right'
    """Exactly the truth was said, or a set of effects that is the same (`equivalences`)."""

    AMBIGUOUS = 'ambiguous, truth among them'
    """Nothing was claimed that is wrong: all that is hidden is among what it names and rivals."""

    PART = 'part of it'
    """Some of what is hidden was named, or its simpler special case, and nothing else."""

    EXTRA = 'extra effect'
    """All that is hidden was named, and something else as well."""

    WRONG = 'wrong name'
    """Something was named that is not there, and something that is there was not."""

    UNKNOWN = 'unknown effect'
    """Something is missing, it said, but not what; right where the catalogue lacks it."""

    MISSED = 'missed'
    """It said that the model is complete."""

    FALSE_ALARM = 'false alarm'
    """Nothing is hidden, and it said that something is missing."""

    INSUFFICIENT = 'insufficient data'
    FAILED = 'failed'
    """It raised an error, crashed or ran out of time."""


@dataclass(frozen=True)
class Named:
    """What one of the peers named.

    Attributes
    ----------
    effects:
        Keys, strongest first.
    seconds:
        Time that it took.
    error:
        Why it named nothing, if it raised.
    """

    effects: tuple[str, ...]
    seconds: float
    error: str = ''


@dataclass(frozen=True)
class Result:
    """One case.

    Attributes
    ----------
    case, category, effects, size:
        Name, kind, what was hidden and how large.
    known:
        Whether the catalogue that the diagnosis had holds all of it.
    motor, profiles, closed, dt, position, process:
        What else was drawn; `process` is the random torque in units of rated torque.
    outcome, verdict, named, first, rivals:
        What was said: effects in order, the strongest candidate of the first round, and what it
        was not told from.
    before, after, reference:
        Held-out error of the base model, of the last model, and of the true structure fitted to
        the same data, percent; the last is None where the catalogue lacks it.
    lacking:
        The least that the true structure, fitted without one of its effects, has; percent.
    floor:
        Error that the sensors alone make, percent.
    evidence:
        dBIC of the first round's strongest candidate.
    sigmas, reference_sigmas:
        ``effect.parameter`` to (estimate - truth) / stated sigma, in the diagnosis's model where
        that has exactly the true effects, and in the reference.
    base_before, base_after, base_reference:
        Base parameter to relative error.
    peers:
        Peer to what it named.
    seconds:
        Time of the diagnosis.
    lent:
        Whether half of the held-out data were fitted as well.
    error:
        What went wrong.
    """

    case: str
    category: str
    effects: tuple[str, ...]
    size: float
    known: bool
    motor: str = ''
    profiles: tuple[str, ...] = ()
    closed: tuple[bool, ...] = ()
    dt: float = 0.0
    position: bool = False
    process: float = 0.0
    outcome: Outcome = Outcome.FAILED
    verdict: str = ''
    named: tuple[str, ...] = ()
    first: str = ''
    rivals: tuple[str, ...] = ()
    before: float | None = None
    after: float | None = None
    reference: float | None = None
    lacking: float | None = None
    floor: float | None = None
    evidence: float | None = None
    sigmas: Mapping[str, float] | None = None
    reference_sigmas: Mapping[str, float] | None = None
    base_before: Mapping[str, float] | None = None
    base_after: Mapping[str, float] | None = None
    base_reference: Mapping[str, float] | None = None
    peers: Mapping[str, Named] | None = None
    seconds: float = 0.0
    lent: bool = False
    error: str = ''

    @property
    def title(self) -> str:
        """What was hidden, for tables."""
        return ' + '.join(self.effects) or 'none'

    @property
    def answer(self) -> str:
        """What was said, for tables."""
        if self.outcome is Outcome.FAILED:
            return 'failed'
        if self.verdict == 'ambiguous':
            return 'ambiguous'
        return ' + '.join(self.named) or self.verdict.replace('_', ' ')

    def as_dict(self) -> dict[str, object]:
        """Return plain values for JSON."""
        return {**asdict(self), 'outcome': self.outcome.name.lower()}

    @classmethod
    def from_dict(cls, document: Mapping[str, object]) -> 'Result':
        """Read what `as_dict` gave, before or after JSON.

        Raises
        ------
        KeyError, TypeError, ValueError
            If it is something else.
        """
        known = {f.name for f in fields(cls)}
        if set(document) != known:
            raise ValueError(f'fields differ: {sorted(known ^ set(document))}')
        values = {k: tuple(v) if isinstance(v, list) else v for k, v in document.items()}
        values['outcome'] = Outcome[str(document['outcome']).upper()]
        peers = document['peers']
        if isinstance(peers, Mapping):
            values['peers'] = {
                name: Named(tuple(one['effects']), float(one['seconds']), str(one['error']))
                for name, one in peers.items()
            }
        return cls(**values)  # type: ignore[arg-type]
