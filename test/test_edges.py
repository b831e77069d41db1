"""What is known of a law that ends at the edge of the data."""

from bench_motor import records
import numpy as np
import pytest
from test_trials import prepared

from motor_sysid.diagnosis.search.edges import beyond_edges, edges_of
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.estimation.batch.uncertainty import describe
from motor_sysid.physics.model import SpeedSensor

HIDDEN = {'drive_coast': {'a': 0.5, 'u_c': 30.0}}


@pytest.fixture(scope='module')
def fitted():
    """Return the largest command, the bench, and the fit with the true effect."""
    data = records(HIDDEN, kinds=('steps', 'triangle'), seconds=3.0)
    bench, base = prepared(data, SpeedSensor.DIFFERENCE)
    top = max(float(np.max(np.abs(r['voltage']))) for r in bench.records)
    return top, bench, base


def spread_at(bench, base, size, edge):
    """Return standard errors without and with what lies beyond the edge, by name."""
    model = base.model.with_effect('drive_coast', {'a': size, 'u_c': edge}, bench.scales)
    model = model.with_free(['drive_coast.u_c'], free=False)
    at_edge = climb(model, bench).model.with_free(['drive_coast.u_c'])
    problem, weighting = bench.problem(at_edge), base.result.weighting
    z = problem.vector()
    spread = describe(problem, z, weighting, problem.linearize(z))
    edges = edges_of(at_edge)
    assert edges == ['drive_coast.u_c']
    told = beyond_edges(
        problem, weighting, spread.covariance, spread.sigma, spread.information, edges
    )
    return {p.name: (s, t) for p, s, t in zip(problem.free, spread.sigma, told, strict=True)}


def test_past_the_last_sample_that_reaches_an_edge_nothing_is_known(fitted):
    top, bench, base = fitted
    found = spread_at(bench, base, 0.3, 0.9995 * top)
    for name in ('drive_coast.a', 'k_t', 'J', 'b'):
        alone, beyond = found[name]
        assert np.isfinite(alone)
        assert beyond == np.inf, name
    assert found['R'][1] == pytest.approx(found['R'][0])


def test_an_edge_that_many_samples_pass_is_known(fitted):
    top, bench, base = fitted
    for alone, beyond in spread_at(bench, base, 0.3, 0.4 * top).values():
        assert beyond == pytest.approx(alone, rel=1e-9)
