"""Curves, maps, evidence, blind spots and differences of a diagnosis as plain values."""

from motor_sysid.diagnosis.result.curves import Curve, Map
from motor_sysid.diagnosis.result.findings import Difference, Evidence, Unknown, WrongParameter
from motor_sysid.diagnosis.result.plain import Json, number, numbers
from motor_sysid.diagnosis.result.result import Diagnosis


def findings_document(diagnosis: Diagnosis) -> dict[str, Json]:
    """Return what a diagnosis says beside its verdict and its ladder."""
    return {
        'unknown': [_unknown(one) for one in diagnosis.unknown],
        'evidence': [_evidence(one) for one in diagnosis.evidence],
        'wrong_parameters': [_wrong(one) for one in diagnosis.wrong_parameters],
        'blind_spots': [
            {
                'code': one.code,
                'parameters': list(one.parameters),
                'effects': list(one.effects),
                'words': one.words,
                'remedy': one.remedy,
            }
            for one in diagnosis.blind_spots
        ],
        'rivalries': [
            {
                'effect': one.effect,
                'rival': one.rival,
                'overlap': number(one.overlap),
                'regime': one.regime,
                'words': one.words,
            }
            for one in diagnosis.rivalries
        ],
        'differences': [_difference(one) for one in diagnosis.differences],
    }


def curve_document(curve: Curve) -> dict[str, Json]:
    """Return a curve with its band as plain values."""
    return {
        'axis': curve.axis,
        'axis_unit': curve.axis_unit,
        'quantity': curve.quantity,
        'unit': curve.unit,
        'x': numbers(curve.x),
        'mean': numbers(curve.mean),
        'band': numbers(curve.band),
        'law': None if curve.law is None else numbers(curve.law),
        'chance': number(curve.chance),
    }


def map_document(drawn: Map) -> dict[str, Json]:
    """Return a map as plain values; value and band are lists of rows."""
    return {
        'x_axis': drawn.x_axis,
        'x_unit': drawn.x_unit,
        'y_axis': drawn.y_axis,
        'y_unit': drawn.y_unit,
        'quantity': drawn.quantity,
        'unit': drawn.unit,
        'x_edges': numbers(drawn.x_edges),
        'y_edges': numbers(drawn.y_edges),
        'value': [numbers(row) for row in drawn.value],
        'band': [numbers(row) for row in drawn.band],
    }


def _unknown(one: Unknown) -> dict[str, Json]:
    return {
        'equation': one.equation,
        'quantity': one.quantity,
        'unit': one.unit,
        'rms': number(one.rms),
        'noise': number(one.noise),
        'axis': one.axis,
        'share': number(one.share),
        'shape': one.shape,
        'amplitude': number(one.amplitude),
        'words': one.words,
        'axes': [
            {
                'axis': a.axis,
                'share': number(a.share),
                'certainty': number(a.certainty),
                'best': a.best,
            }
            for a in one.axes
        ],
        'curve': None if one.curve is None else curve_document(one.curve),
    }


def _evidence(one: Evidence) -> dict[str, Json]:
    return {
        'effect': one.effect,
        'title': one.title,
        'delta_bic': number(one.delta_bic),
        'error_share_percent': number(one.error_share_percent),
        'gain_percent': number(one.gain_percent),
        'parameters': {
            name: {
                'value': number(value),
                'unit': unit,
                'sigma': number(sigma),
                'low': number(low),
                'high': number(high),
            }
            for name, (value, unit, sigma, low, high) in one.parameters.items()
        },
        'plausible': one.plausible,
        'plausibility': one.plausibility,
        'words': one.words,
    }


def _wrong(one: WrongParameter) -> dict[str, Json]:
    return {
        'name': one.name,
        'description': one.description,
        'unit': one.unit,
        'before': number(one.before),
        'after': number(one.after),
        'sigma_before': number(one.sigma_before),
        'sigma_after': number(one.sigma_after),
        'factor': number(one.factor),
        'words': one.words,
    }


def _difference(one: Difference) -> dict[str, Json]:
    return {
        'name': one.name,
        'description': one.description,
        'unit': one.unit,
        'values': [
            {
                'record': each.record,
                'value': number(each.value),
                'low': number(each.low),
                'high': number(each.high),
                'searched': each.searched,
            }
            for each in one.values
        ],
        'words': one.words,
    }
