"""One record that is not like the others: what is missing in those, and what in it.

A shaft that somebody held, a belt that slipped, a load that came on: where that happens in one
record of several, no model describes all of them, and what they all lack has no name either.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.own_values import Again, FINE, nearest, whole_chains
from motor_sysid.diagnosis.result.names import listed, titles
from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.refusals import MIN_SAMPLES
from motor_sysid.diagnosis.verdict.between_records import names_of
from motor_sysid.diagnosis.where.uneven_records import but_for_few, by_chain
from motor_sysid.estimation.batch import Chain, fit_and_slopes, Problem, white
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

FEWEST = 3
"""Records of which one may be odd."""

ODD = 2.0
"""Error of the odd record in an output, in units of the largest of the others."""

_NOTHING_TOLD = (Verdict.UNKNOWN_EFFECT, Verdict.INSUFFICIENT_DATA)
"""Verdicts over the others that tell no more than one over all."""


@dataclass(frozen=True)
class Odd:
    """A record that is not like the others.

    Attributes
    ----------
    number:
        Which one.
    times:
        How many times larger the error of an output is there than in any other record.
    signal:
        That output.
    """

    number: int
    times: float
    signal: str


def without_odd_record(
    found: Diagnosis, bench: Bench, train: Sequence[Record], validation: Sequence[Record],
    again: Again, tell: Callable[[str], None],
) -> Diagnosis:  # fmt: skip
    """Return what was found, or what is found over all records but one that is not like them.

    Only where something unknown is left, and where that is not so over the others.  What is named
    there has to be what the odd record lacks by itself, too: fewer records refute less, and what
    the catalogue does not hold may look like something else in those that are left.

    Parameters
    ----------
    found, bench:
        A diagnosis, and on what.
    train, validation:
        Its records, prepared.
    again:
        Searches others.
    tell:
        Is told what is going on.
    """
    records = [*train, *validation]
    unknown = found.verdict is Verdict.UNKNOWN_EFFECT and not found.differences
    if len(records) < FEWEST or not (found.unknown or unknown):
        return found
    chains = whole_chains(records, bench)
    models = [found.model, *([nearest(found)] if nearest(found) is not found.model else [])]
    odd = max((_suspected(one, chains, bench) for one in models), key=lambda one: one.times)
    fitted = [record for k, record in enumerate(train) if k != odd.number]
    judged = [r for k, r in enumerate(validation, start=len(train)) if k != odd.number]
    if odd.times < ODD or not fitted or sum(map(len, fitted)) < MIN_SAMPLES:
        return found
    tell(f'{names_of(records)[odd.number]} is not like the others: looking once more without it')
    rest = again(fitted, judged)
    odd = _judged(odd.number, _errors(rest.model, chains, bench), bench)
    if rest.unknown or rest.verdict in _NOTHING_TOLD or odd.times < ODD:
        return found
    own = records[odd.number]
    alone = again([own], []) if len(own) >= MIN_SAMPLES else None
    verdict, *further = found.reasons
    if rest.verdict is Verdict.COMPLETE:
        return replace(found, reasons=(verdict, *_alone_odd(odd, records, alone), *further))
    if set(rest.effects) <= set(alone.effects if alone else ()):
        return _told(rest, odd, records, alone)
    return replace(found, reasons=(verdict, _unproven(rest, odd, records), *further))



def _suspected(model: Model, chains: Sequence[Chain], bench: Bench) -> Odd:
    """Return the record that stands out, as odd as it is with the model fitted to the others."""
    number = _oddest(_errors(_fitted(model, chains, bench), chains, bench))
    others = [chain for k, chain in enumerate(chains) if k != number]
    return _judged(number, _errors(_fitted(model, others, bench), chains, bench), bench)


def _fitted(model: Model, chains: Sequence[Chain], bench: Bench) -> Model:
    problem = Problem(model, chains, bench.outputs, substeps=max(bench.substeps, FINE))
    return fit_and_slopes(problem, reweight=1, iterations=10)[0].model


def _errors(model: Model, chains: Sequence[Chain], bench: Bench) -> Array:
    """Return (n, n_y) errors that a model leaves of each record, root mean square."""
    problem = Problem(model, chains, bench.outputs, substeps=max(bench.substeps, FINE))
    near = problem.linearize(problem.vector(), parameters=False)
    plain = white([part.residual for part in near])
    settled = [problem.settled(part, plain) for part in near]
    return np.array([but_for_few(part) for part in by_chain(settled, chains)])


def _oddest(errors: Array) -> int:
    """Return the number of the record that stands out most in some output."""
    return int(np.argmax(np.max(_ratio(errors, np.median(errors, axis=0)), axis=1)))


def _ratio(errors: Array, others: Array) -> Array:
    """Return how many times larger errors are than others; 0 where neither is a number."""
    with np.errstate(divide='ignore', invalid='ignore'):
        return np.nan_to_num(errors / others, posinf=np.finfo(float).max)


def _judged(number: int, errors: Array, bench: Bench) -> Odd:
    """Return how odd a record is, by (n, n_y) errors of all."""
    times = _ratio(errors[number], np.max(np.delete(errors, number, axis=0), axis=0))
    output = int(np.argmax(times))
    return Odd(number, float(times[output]), bench.outputs[output])


def _unlike(odd: Odd, names: Sequence[str]) -> str:
    return (
        f'{names[odd.number]} is not like the others: with what describes those its error of the '
        f'{odd.signal} is {odd.times:.2g} times as large as in any of them'
    )


def _all_but(odd: Odd, names: Sequence[str]) -> str:
    return listed([*names[: odd.number], *names[odd.number + 1 :]])


def _alone_odd(
    odd: Odd, records: Sequence[Record], alone: Diagnosis | None
) -> tuple[str, ...]:
    """Say which record is not like the others, which lack nothing."""
    names = names_of(records)
    said = f'{_unlike(odd, names)}. Over {_all_but(odd, names)} alone nothing is missing'
    return (said, *_by_itself(names[odd.number], alone))


def _unproven(rest: Diagnosis, odd: Odd, records: Sequence[Record]) -> str:
    names = names_of(records)
    return (
        f'{_unlike(odd, names)}. Over {_all_but(odd, names)} alone {titles(rest.effects)} would '
        f'be named, and nothing else is missing there; but {names[odd.number]} by itself does not '
        'ask for that, so it may stand for something else'
    )


def _told(
    rest: Diagnosis, odd: Odd, records: Sequence[Record], alone: Diagnosis | None
) -> Diagnosis:
    """Return a diagnosis of the other records, and say which is not like them."""
    names = names_of(records)
    said = (
        f'{_unlike(odd, names)}. Searched, and shown, over {_all_but(odd, names)} alone',
        *_by_itself(names[odd.number], alone),
    )
    verdict, *further = rest.reasons
    return replace(rest, reasons=(verdict, *said, *further))


def _by_itself(name: str, alone: Diagnosis | None) -> tuple[str, ...]:
    """Say what is missing in the odd record, if that is known."""
    if alone is None or alone.verdict is Verdict.INSUFFICIENT_DATA:
        return ()
    if alone.verdict is Verdict.COMPLETE:
        return (f'By itself {name} lacks nothing that it shows: its parameters are others',)
    if alone.unknown or not alone.effects:
        return (f'What is missing in {name} is not in the catalogue',)
    return (f'By itself {name} lacks {titles(alone.effects)}',)
