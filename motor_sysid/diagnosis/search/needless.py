"""Whether the last effect that was added may as well be left out, once all is fitted exactly."""

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.gain import gain_percent
from motor_sysid.diagnosis.search.gates import MIN_WIDER_GAIN_PERCENT, SURE_GAIN, why_idle
from motor_sysid.diagnosis.search.integration_steps import exact
from motor_sysid.diagnosis.search.refit import chatters
from motor_sysid.diagnosis.search.rung import Rung


def why_needless(rung: Rung, before: Rung, bench: Bench) -> str:
    """Return why the last effect of an exact fit may as well be left out, or nothing.

    What lowers the error by little may but make up for blunt signs and coarse steps of the fit
    `before` it, which then is made as exact; so it is for more where the current chatters about
    its sign, which holds a fit far from the best one.  Nothing is said where `before` has effects
    that the last fit lacks: then it is not the same model without one.
    """
    if not set(before.model.effects) < set(rung.model.effects):
        return ''
    key, duration = rung.model.effects[-1], bench.scales.duration
    why = why_idle(rung, before, key, duration)
    gain = gain_percent(before.held, rung.held)
    little = SURE_GAIN if chatters(rung.model) else MIN_WIDER_GAIN_PERCENT
    if why or not before.model.effects or gain > little:
        return why
    return why_idle(rung, exact(before, bench)[0], key, duration)
