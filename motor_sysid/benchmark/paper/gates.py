"""What the benchmark must show, as a list of gates that pass or fail."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motor_sysid.benchmark.paper.fitting import told_by
from motor_sysid.benchmark.paper.motor import HiddenRun, MotorRun
from motor_sysid.benchmark.paper.runs import ANYWHERE, grouped, Run
from motor_sysid.benchmark.paper.studies import NOISE, record, RECORDS

LIMITS: Mapping[str, tuple[float, float, float]] = {
    'D1': (1.7, 5.3, 17.0), 'D2': (0.65, 2.1, 6.6), 'D3': (0.55, 1.8, 5.6),
    'D4': (0.15, 0.45, 1.4),
}  # fmt: skip
"""95th percentile of the worst error that the recommended fit shall keep, percent, by noise."""

_DRAWS = 20_000
_ENOUGH = 10
"""Seeds from which a percentile, an RMS or a share of intervals is judged."""


@dataclass(frozen=True)
class Gate:
    """One gate.

    Attributes
    ----------
    title, goal, measured:
        What is asked, how much, and what there is.
    passed:
        Whether it is met.
    note:
        What else to know.
    few:
        Whether there are too few runs for it to say anything.
    """

    title: str
    goal: str
    measured: str
    passed: bool
    note: str = ''
    few: bool = False


def gates(
    runs: Sequence[Run], motors: Sequence[MotorRun], hidden: Sequence[HiddenRun]
) -> list[Gate]:
    """Return every gate for which there are runs."""
    groups = grouped(list(runs))
    return [
        *_exact(groups), *_noise(groups), *_efficient(groups), *_unseen(groups), *_time(runs),
        *_motor(motors), *_hidden(hidden),
    ]  # fmt: skip


Groups = Mapping[tuple[str, str], Sequence[Run]]


def _exact(groups: Groups) -> list[Gate]:
    found = []
    for method, title in (('best', 'recommended fit'), ('wide', 'wide box and polish')):
        runs = groups.get((ANYWHERE, method), ())
        if runs:
            good, worst = sum(r.worst <= 1e-3 for r in runs), max(r.worst for r in runs)
            found.append(Gate(
                f'Noise-free, a plant of its own for each seed: {title}',
                f'at most 0.001 % in {len(runs)} of {len(runs)}',
                f'{good} of {len(runs)}, worst {worst:.2g} %', good == len(runs),
            ))  # fmt: skip
    for reading in ('R1', 'R2', 'R3'):
        polished = [r for (s, m), g in groups.items() for r in g
                    if s == reading and (m.endswith('polished') or m == 'best')]  # fmt: skip
        if polished:
            worst = max(r.itae for r in polished)
            good = sum(r.itae <= 1e-6 for r in polished)
            found.append(Gate(
                f'ITAE of every polished run and the recommended fit, {reading}', 'at most 1e-6',
                f'{good} of {len(polished)}, worst {worst:.2g}', worst <= 1e-6,
            ))  # fmt: skip
    return found


def _noise(groups: Groups) -> list[Gate]:
    found = []
    for data in RECORDS:
        for decibel, limit in zip(NOISE, LIMITS[data], strict=True):
            runs = groups.get((f'{data}@{decibel}', 'best'), ())
            if runs:
                p95 = float(np.quantile([r.worst for r in runs], 0.95))
                ideal = efficient_p95(data, decibel)
                found.append(Gate(
                    f'Worst parameter, 95th percentile, {data} at {decibel} dB',
                    f'at most {limit:g} %', f'{p95:.3g} %', p95 <= limit,
                    f'an efficient estimator has {ideal:.3g} %', len(runs) < _ENOUGH,
                ))  # fmt: skip
    return found


def efficient_p95(data: str, decibel: int) -> float:
    """Return the 95th percentile of the worst error of an estimator at the bound, in percent."""
    study = record(data, decibel, 0)
    told = told_by(study, study.plant, study.sigma)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(np.zeros(4), told.covariance, _DRAWS)
    relative = np.abs(draws) / study.plant[[0, 1, 3, 4]]
    return 100 * float(np.quantile(relative.max(axis=1), 0.95))


def _efficient(groups: Groups) -> list[Gate]:
    scored = {
        s: np.array([r.scores for r in g]) for (s, m), g in groups.items()
        if m == 'best' and g[0].scores
    }  # fmt: skip
    if not scored:
        return []
    rms = {s: np.sqrt(np.mean(x**2, axis=0)) for s, x in scored.items()}
    worst = max(rms, key=lambda s: float(rms[s].max()))
    pooled = float(np.sqrt(np.mean(np.concatenate(list(scored.values())) ** 2)))
    covered = np.mean([r.covered for (s, m), g in groups.items() if s in scored and m == 'best'
                       for r in g])  # fmt: skip
    count = len(next(iter(scored.values())))
    return [
        Gate('RMS error over Cramer-Rao bound, every parameter and record', 'at most 1.25',
             f'worst {rms[worst].max():.2f} ({worst}), all together {pooled:.2f}',
             bool(rms[worst].max() <= 1.25),
             f'of {count} runs an efficient estimator has 1 +- {1 / np.sqrt(2 * count):.2f} each',
             count < _ENOUGH),
        Gate('95 % intervals hold the truth', '90 to 99 %', f'{100 * covered:.1f} %',
             bool(0.9 <= covered <= 0.99), few=count < _ENOUGH),
    ]  # fmt: skip


def _unseen(groups: Groups) -> list[Gate]:
    found = []
    clean, noisy = groups.get(('D2@clean', 'best'), ()), groups.get(('D2@30', 'best'), ())
    if clean:
        least = min(r.unseen_fit for r in clean)
        found.append(Gate('Fit on unseen steps, from D2 without noise', 'at least 99.8 %',
                          f'{least:.6g} %', least >= 99.8))  # fmt: skip
    if noisy:
        middle = float(np.median([r.unseen_itae for r in noisy]))
        found.append(Gate('Median ITAE on unseen steps, from D2 at 30 dB', 'at most 0.4',
                          f'{middle:.3g}', middle <= 0.4, few=len(noisy) < _ENOUGH))  # fmt: skip
    return found


def _time(runs: Sequence[Run]) -> list[Gate]:
    best = [r.seconds for r in runs if r.method == 'best']
    swarm = [r.seconds for r in runs if r.method not in ('best', 'ls')]
    found = []
    for title, limit, seconds in (('recommended fit', 0.5, best), ('30 x 50 search', 1.0, swarm)):
        if seconds:
            p99 = float(np.quantile(seconds, 0.99))
            found.append(Gate(f'Processor time, {title}', f'at most {limit:g} s',
                              f'median {np.median(seconds):.3f} s, 99 % within {p99:.3f} s',
                              p99 <= limit))  # fmt: skip
    return found


def _motor(motors: Sequence[MotorRun]) -> list[Gate]:
    if not motors:
        return []
    scores = np.array([r.scores for r in motors])
    rms = float(np.sqrt(np.mean(scores**2)))
    covered = float(np.mean([r.covered for r in motors]))
    return [
        Gate('Motor with current measured: RMS error over bound', 'at most 1.25', f'{rms:.2f}',
             rms <= 1.25, few=len(motors) < _ENOUGH),
        Gate('Motor with current measured: 95 % intervals hold the truth', '90 to 99 %',
             f'{100 * covered:.1f} %', 0.9 <= covered <= 0.99, few=len(motors) < _ENOUGH),
    ]  # fmt: skip


def _hidden(runs: Sequence[HiddenRun]) -> list[Gate]:
    without, with_it = ([r for r in runs if bool(r.tau_c) is there] for there in (False, True))
    found = []
    if with_it:
        seen = all(r.whiteness < 1e-3 and 1 <= r.place <= 3 and r.flagged for r in with_it)
        off = max(abs(r.found / r.tau_c - 1) for r in with_it)
        chi2, fit = max(r.chi2 for r in with_it), min(r.fit for r in with_it)
        found += [
            Gate('Hidden Coulomb torque is flagged and among the first three',
                 f'{len(with_it)} of {len(with_it)}, Ljung-Box p < 0.001',
                 f'places {", ".join(str(r.place) for r in with_it)}', seen),
            Gate('Once added: torque, chi2 per degree of freedom, fit on unseen steps',
                 'within 2 %, at most 1.1, at least 99.5 %',
                 f'{100 * off:.2g} %, {chi2:.3f}, {fit:.2f} %',
                 off <= 0.02 and chi2 <= 1.1 and fit >= 99.5),
        ]  # fmt: skip
    if without:
        quiet = sum(not r.flagged for r in without)
        found.append(Gate('No false flag without it', 'at least 95 %',
                          f'{quiet} of {len(without)}', quiet >= 0.95 * len(without)))  # fmt: skip
    return found
