"""What a fitted model leaves."""

from collections.abc import Sequence

from motor_sysid.diagnosis.candidates.matched_filter import Matched, STANDS_OUT
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import Rung, slopes
from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.diagnosis.where.other_values import held_at_best
from motor_sysid.diagnosis.where.remainder import examine_remainder, Remainder
from motor_sysid.estimation.batch import Problem
from motor_sysid.estimation.batch.methods.reference import moving_references
from motor_sysid.signals.record import Record


def left_over(rung: Rung, bench: Bench, records: Sequence[Record]) -> Remainder:
    """Examine what a fitted model leaves of the training `records` and of the held-out data.

    In a closed loop random loads bias a fit a little; that is no missing physics.  So what is left
    there is looked at with the model's own parameters at their best.
    """
    matched = Matched(bench.problem(rung.model), slopes(rung, bench))
    closed = any(moving_references(record) for record in records)
    training, looks = rung.training, rung.held
    if bench.train is not bench.train_free:
        training, looks = (
            compare(rung.model, part, bench.outputs, substeps=bench.substeps, as_measured=True)
            for part in (bench.train, bench.held)
        )
    held = Problem(rung.model, bench.held, bench.outputs)
    best, other = held_at_best(held, looks.residuals, rung.result.weighting)
    return examine_remainder(
        bench.outputs,
        training,
        rung.validation,
        best if closed else looks,
        (bench.train, bench.held),
        bench.differenced(rung.model),
        (matched.orders(contrast=STANDS_OUT), matched.led_orders()),
        other,
    )
