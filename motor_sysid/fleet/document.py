"""What there is to say of a fleet as JSON: schema ``motor_sysid/fleet/1``."""

from motor_sysid.diagnosis.result.document import model_parameters
from motor_sysid.fleet.spread import Spread
from motor_sysid.fleet.survey import Fleet, Member


def fleet_document(fleet: Fleet) -> dict[str, object]:
    """Return the document; see docs/fleet.md."""
    return {
        'schema': 'motor_sysid/fleet/1',
        'motor': fleet.motor,
        'effects': list(fleet.effects),
        'members': [_member(fleet, one) for one in fleet.members],
        'parameters': [_spread(one) for one in fleet.spreads],
    }


def _member(fleet: Fleet, one: Member) -> dict[str, object]:
    base, own, common = one.errors
    return {
        'name': one.name,
        'verdict': one.verdict.value if one.verdict else None,
        'effects': list(one.effects),
        'reason': one.reason,
        'base_error_percent': base,
        'own_error_percent': own,
        'common_error_percent': common,
        'odd': fleet.oddities(one),
        'parameters': model_parameters(one.model) if one.model else {},
    }


def _spread(one: Spread) -> dict[str, object]:
    return {
        'name': one.parameter,
        'unit': one.unit,
        'mean': one.mean,
        'scatter': one.scatter,
        'relative': one.relative,
        'odd': [{'name': odd.name, 'p_value': odd.p_value} for odd in one.odd],
    }
