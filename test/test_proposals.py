"""What the data propose: orders, moments and frequencies, read from the unexplained torque."""

import numpy as np
import pytest

from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.diagnosis.candidates.proposals import _lacks, _turning, proposals
from motor_sysid.estimation.batch import (
    Linearization,
    make_chain,
    observed_outputs,
    Problem,
)
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.scales import scales_of
from motor_sysid.signals.record import Record

DT = 1e-3
PLANT = Plant(R=2.1, L=2.4e-3, k=0.046, J=2.6e-5, b=1.3e-5)
BASE = {'R': 2.1, 'L': 2.4e-3, 'k_t': 0.046, 'J': 2.6e-5, 'b': 1.3e-5, 'omega_eps': 0.4}
SENSORS = Sensors(
    counts=4096, tacho_noise=0.2, current_noise=0.012, current_step=20 / 4096, current_offset=0.0
)


def a_record(seconds: float = 8.0, **hidden: float) -> Record:
    """Return a record in closed loop of the motor with something hidden."""
    rng = np.random.default_rng(11)
    count = round(seconds / DT)
    reference = np.repeat(rng.uniform(-120, 120, count // 400 + 1), 400)[:count]
    control = Control(reference, kp=0.05, ki=0.6, limit=12.0, counts=4096)
    return measure(run(PLANT._replace(**hidden), control, DT), SENSORS, DT, rng)


def prepared(model: Model, records: list[Record]) -> tuple[Problem, list[Linearization]]:
    outputs = observed_outputs(model.kind, records)
    problem = Problem(model, [make_chain(r, model.kind, outputs) for r in records], outputs)
    return problem, problem.linearize(problem.vector())


def proposed(key: str, records: list[Record], **values: float) -> tuple[float, ...]:
    model = Model.base('brushed_dc', {**BASE, **values}, speed_sensor=SpeedSensor.DIFFERENCE)
    scales = scales_of('brushed_dc', model.parameters.values(), records)
    return proposals(*prepared(model, records), records, [catalogue()[key]], scales).get(key, ())


def turning(model: Model, record: Record) -> tuple[int, ...]:
    scales = scales_of('brushed_dc', model.parameters.values(), [record])
    lacks = _lacks(model, [record], 'torque')
    return _turning(catalogue()['cogging_torque'], 'torque', lacks, scales)


@pytest.mark.parametrize('wrong', [{}, {'J': 3.1e-5, 'b': 5e-5}])
def test_the_moment_of_a_load_step_is_found(wrong):
    record = a_record(step_torque=4e-3, step_time=3.37)
    moments = proposed('load_torque_step', [record], **wrong)
    assert min(abs(t - 3.37) for t in moments) < 0.03


def test_the_moment_of_an_inertia_change_is_found():
    record = a_record(inertia_gain=0.3, inertia_time=5.21)
    moments = proposed('inertia_change', [record], J=2.9e-5)
    assert min(abs(t - 5.21) for t in moments) < 0.05


def test_moments_count_from_the_start_of_the_record():
    record = a_record(step_torque=4e-3, step_time=3.37)
    later = Record(record.time + 1e6, record.signals, record.units)
    here, there = (proposed('load_torque_step', [r]) for r in (record, later))
    assert there == pytest.approx(here, abs=1e-3)


@pytest.mark.parametrize('frequency', [0.83, 6.1, 23.0])
def test_the_frequency_of_a_load_is_found(frequency):
    record = a_record(swing=2e-3, frequency=frequency)
    best = proposed('periodic_load', [record])
    assert min(abs(f - frequency) for f in best) < 0.05


def test_the_frequency_of_a_load_is_found_where_only_counts_of_a_position_are_recorded():
    """Runs over short pieces set in anew: waves at other frequencies explain their errors, too."""
    dt, inertia, drag, frequency = 4e-3, 5.9, 4.2, 2.13
    time = np.arange(5000) * dt
    force = np.repeat(np.random.default_rng(3).uniform(-30, 30, 100), 50)
    fine = np.repeat(force, 4) + 7 * np.sin(2 * np.pi * frequency * np.arange(20_000) * dt / 4)
    speed = np.zeros(fine.size)
    for k in range(1, fine.size):
        speed[k] = speed[k - 1] + dt / 4 * (fine[k - 1] - drag * speed[k - 1]) / inertia
    position = np.round(np.cumsum(speed)[::4] * dt / 4 / 2e-6) * 2e-6
    record = Record(time, {'force': force, 'position': position}, {'force': 'N', 'position': 'm'})
    model = Model.base('mechanical_axis', {'J': inertia, 'b': drag}, linear=True)
    chain = make_chain(record, model.kind, ('position',), horizon=2.5)
    problem = Problem(model, [chain], ('position',))
    near = problem.linearize(problem.vector())
    scales = scales_of('mechanical_axis', model.parameters.values(), [record])
    load = catalogue()['periodic_load']
    best = proposals(problem, near, [record], [load], scales)['periodic_load']
    assert min(abs(f - frequency) for f in best) < 0.01


def test_the_order_of_a_ripple_is_found_under_currents_of_both_signs():
    record = a_record(ripple=0.1, ripple_order=12.0)
    assert 12.0 in proposed('torque_ripple', [record])


@pytest.mark.parametrize('stalls', [False, True])
def test_the_order_of_a_wave_stands_out_of_the_unexplained_torque(stalls):
    """Cogging of 2 % of the largest torque; and shocks of a hundred times that in some samples."""
    record = a_record(cogging=2e-3, order=23.0)
    if stalls:
        places = np.random.default_rng(3).integers(0, len(record), 40)
        current = record['current'].copy()
        current[places] += 5.0
        record = record.with_signal('current', current, 'A')
    model = Model.base('brushed_dc', BASE, speed_sensor=SpeedSensor.DIFFERENCE)
    assert turning(model, record) == (23,)


def test_no_order_stands_out_of_a_complete_motor():
    model = Model.base('brushed_dc', BASE, speed_sensor=SpeedSensor.DIFFERENCE)
    assert turning(model, a_record()) == ()


def test_few_values_are_proposed():
    record = a_record()
    for key in ('load_torque_step', 'inertia_change', 'periodic_load', 'torque_ripple'):
        assert len(proposed(key, [record])) <= 5


def test_an_axis_without_records_of_its_torque_proposes_nothing():
    record = a_record().select(['voltage', 'speed'])
    model = Model.base('brushed_dc', BASE)
    scales = scales_of('brushed_dc_reduced', {'k_v': 0.05}, [record])
    one = catalogue()['load_torque_step']
    found = proposals(*prepared(model, [record]), [record], [one], scales)
    assert found['load_torque_step'] == ()
