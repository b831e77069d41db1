"""What has to be said of the paper's set-up before any of its numbers is compared."""

from functools import lru_cache

import numpy as np

from motor_sysid.benchmark.paper.fitting import told_by
from motor_sysid.benchmark.paper.motor import ranks
from motor_sysid.benchmark.paper.plant import simulate, TRUE
from motor_sysid.benchmark.paper.stability import stability
from motor_sysid.benchmark.paper.studies import OPEN, OUTSIDE, PRINTED, READINGS, Study
from motor_sysid.estimation.batch.information import information

_STEP = 1e-5


@lru_cache(maxsize=1)
def statements() -> tuple[tuple[str, str], ...]:
    """Return pairs of a subject and what is the case."""
    printed = stability(PRINTED)
    runaway = [float(np.max(np.abs(simulate(TRUE[np.newaxis, :], np.ones(n), PRINTED))))
               for n in (500, 1000)]  # fmt: skip
    return (
        ('plant', 'b e^(-tau s)/(a2 s^2 + a1 s + a0) with a0 = B R + K_t K_e = 5, a1 = 3, '
         'a2 = 1, b = 5, tau = 1 s; the printed a0 = B R + K_t R would be 12'),
        ('identifiable', f'{_rank()} of 5 parameters: a0, a1, a2 and b share a free factor; '
         'a0/a2, a1/a2, b/a2 and tau are what records hold'),
        ('printed closed loop',
         f'unstable with the delay inside: {printed.unstable_poles} poles in the right half '
         f'plane, delay margin {printed.delay_margin:.3f} s against 1 s, stable only with gains '
         f'under {100 * printed.gain_limit:.1f} % of the printed; the output reaches '
         f'{runaway[0]:.3g} in 5 s and {runaway[1]:.3g} in 10 s'),
        ('readings', 'R1 open loop; R2 controller around the output before the delay; R3 delay '
         'inside, gains a tenth.  Only R1 and R2 give numbers of the size of Table 4'),
        ('ITAE', 'sum of t |e| dt from the step on, dt = 0.01 s; a sum of |e| times the number '
         'of samples is no ITAE.  Open and closed loop are never in one ranking: the loop hides '
         'errors of the model'),
        ('not printed', 'sample time, horizon, bounds, step size, validation input, form of the '
         'PID, coding of the GA, loudness laws of the BA, structure of the NN'),
        ('NN', 'not run: a black box has no parameters; its printed open-loop column is '
         'impossible (ten values with that mean, minimum and maximum deviate by 0.27 at least, '
         'printed 0.19)'),
        ('bounds, unit step, noise 0.01', f'a0, a1, b, tau: open loop {_bounds(OPEN)}; loop '
         f'around the output before the delay {_bounds(OUTSIDE)}'),
        *(_motor_ranks()),
    )  # fmt: skip


def _rank() -> int:
    """Return the rank of all five parameters, the same in every reading."""
    found = set()
    for reading in READINGS.values():
        study = reading.study()
        moves = TRUE * (1 + _STEP * np.vstack([np.eye(5), -np.eye(5)]))
        runs = study.simulate(moves)
        found.add(information((runs[:5] - runs[5:]).T / (2 * _STEP), list('abcde')).rank)
    (rank,) = found
    return rank


def _bounds(loop: object) -> str:
    reading = next(r for r in READINGS.values() if r.loop == loop)
    study: Study = reading.study()
    told = 100 * told_by(study, TRUE, 0.01).bound / TRUE[[0, 1, 3, 4]]
    return ' '.join(f'{b:.2f}' for b in told) + ' %'


def _motor_ranks() -> list[tuple[str, str]]:
    found = [f'{told.rank} of {len(told.names)} from {title}' for title, told in ranks().items()]
    return [('a motor with K_t = K_e', 'numbers that can be identified: ' + ', '.join(found))]
