"""One round of a diagnosis: score every candidate on a fitted model, refit the best."""

from collections.abc import Callable, Sequence

from motor_sysid.diagnosis.proposals import proposals
from motor_sysid.diagnosis.refit import best_per_effect, Rung, slopes, Trial, try_effect
from motor_sysid.diagnosis.score import score, Scores
from motor_sysid.diagnosis.setup import Bench
from motor_sysid.diagnosis.variants import variants
from motor_sysid.physics.effect import Effect

Tell = Callable[[str], None]


def scored(rung: Rung, bench: Bench, candidates: Sequence[Effect], tell: Tell) -> Scores:
    """Score every candidate that can be added to a fitted model."""
    problem = bench.problem(rung.model)
    train = [r for r, role in zip(bench.records, bench.roles, strict=True) if role == 'train']
    proposed = proposals(rung.model, train, candidates, bench.scales)
    tried = list(variants(rung.model, bench.scales, candidates, proposed))
    tell(f'scoring {len(tried)} variants of {len({v.effect.key for v in tried})} effects')
    return score(problem, problem.vector(), tried, slopes(rung, bench))


def refitted(scores: Scores, rung: Rung, bench: Bench, limit: int, tell: Tell) -> list[Trial]:
    """Refit at most `limit` effects, best score first, and then special cases of those.

    Returns
    -------
    Those that pass before others, best first.
    """
    trials: list[Trial] = []
    special: set[str] = set()
    for starts in best_per_effect(scores.singles, limit):
        one = starts[0].variant.effect
        if starts[0].delta_bic > 0.0 or one.key in special or not trials:
            special |= set(one.card.generalises)
            tell(f'refitting with {starts[0].variant.effect.card.title}')
            trials.append(try_effect(starts, rung, bench, scores.weighting))
    trials.sort(key=lambda t: (not t.passes, -t.delta_bic))
    return trials
