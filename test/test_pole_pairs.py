"""Pole pairs of a PMSM are read from a record where it tells them, and else asked for."""

import numpy as np
import pytest

from motor_sysid.benchmark.machine import PMSM_SHEETS
from motor_sysid.benchmark.three_phase_rig import Hidden, pmsm, Rig, Sensors
from motor_sysid.diagnosis.search.bench import make_bench, prepared
from motor_sysid.errors import UserError
from motor_sysid.physics.motors import motor
from motor_sysid.physics.motors.pmsm import start
from motor_sysid.signals import Record


def recorded(seed: int, pairs: int) -> Record:
    """Return 4 s at 1 kHz of a motor of the rig with so many pole pairs."""
    rng = np.random.default_rng(seed)
    sheet = PMSM_SHEETS[seed % 3]
    rng.choice([2, 4, 7, 11, 15])
    plain = sheet.machine
    machine = plain._replace(pole_pairs=pairs, J=plain.J * (1 if seed % 3 == 2 else 4))
    steps = Sensors(2 * np.pi / 4096, 0.005 * sheet.current, sheet.current / 1000, np.zeros(3))
    rig = Rig(Hidden(machine), sheet, steps, rng)
    top = min(1.0, float(rng.uniform(0.4, 1.4)) / (pairs * 1e-3) / (0.36 * sheet.top_speed))
    time = np.arange(4000) * 1e-3

    def levels(time: np.ndarray, slow: float, rng: np.random.Generator) -> np.ndarray:
        return np.asarray(top * np.repeat(rng.uniform(-1, 1, 20), 200))

    return pmsm(rig, time, levels, bool(seed % 2), rng)


@pytest.mark.parametrize(('seed', 'pairs'), [(120, 4), (105, 4), (122, 15), (104, 11)])
def test_pole_pairs_are_right_though_currents_settle_or_the_field_turns_in_a_sample(
    seed: int, pairs: int
) -> None:
    """Trapezoids took these for 3, 3, 16 and 12."""
    assert start(prepared([recorded(seed, pairs)], 'pmsm', {}), {})['pole_pairs'] == pairs


@pytest.mark.parametrize(('seed', 'pairs'), [(124, 15), (138, 11)])
def test_pole_pairs_that_are_not_singled_out_are_asked_for(seed: int, pairs: int) -> None:
    with pytest.raises(UserError, match='--nominal'):
        start(prepared([recorded(seed, pairs)], 'pmsm', {}), {})


def test_that_pole_pairs_were_read_from_the_record_is_said() -> None:
    records, said = prepared([recorded(107, 2)], 'pmsm', {}), 'pole pairs 2 were read from'
    assert any(said in note for note in make_bench(records, [], motor('pmsm')).notes)
    given = make_bench(records, [], motor('pmsm'), nominal={'pole_pairs': 2.0})
    assert not any(said in note for note in given.notes)
