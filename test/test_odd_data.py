"""Where something unknown is missing, the diagnosis says what is odd about the data."""

from types import SimpleNamespace

import numpy as np

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.diagnose import beyond_training
from motor_sysid.signals.record import Record

DT, PARTS = 0.02, 400


def logged(seed: int, late: int) -> Record:
    """Return the log of a geared motor with dry friction: set, wait, read, log; or in order.

    Resistance 4 ohm, 18 mV s/rad, friction of 2.5 mN m that holds for certain at rest, an encoder
    of 44 counts; steps of 50 us.
    """
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(-12, 12, 100), rng.integers(15, 60, 100))[:1500]
    counts, speed, angle, h = [0.0], 0.0, 0.0, DT / PARTS
    for u in volts[:-1]:
        for _ in range(PARTS):
            torque = 0.018 * (u - 0.018 * speed) / 4.0 - 2e-6 * speed
            if abs(speed) < 0.3 and abs(torque) < 2.5e-3:
                speed = 0.0
            else:
                speed += h * (torque - 2.5e-3 * np.sign(speed or torque)) / 3.5e-6
            angle += h * speed
        counts.append(np.floor(44 * angle / (2 * np.pi)))
    shown = np.diff(counts, prepend=0.0) / 44 * 2 * np.pi / DT
    volts = np.concatenate((np.zeros(late), volts))[: volts.size]
    columns = {'voltage': volts, 'speed': shown}
    return Record(DT * np.arange(1500), columns, {'voltage': 'V', 'speed': 'rad/s'})


def test_a_voltage_logged_a_row_late_is_told_beside_an_unknown_effect():
    found = diagnose([logged(1, 1)], [logged(2, 1)])
    assert found.verdict is Verdict.UNKNOWN_EFFECT
    assert 'answers voltage within the same row' in found.reasons[0]
    assert 'shift: -1' in found.reasons[0]


def test_in_order_the_friction_is_named_and_nothing_is_odd():
    found = diagnose([logged(1, 0)], [logged(2, 0)])
    assert found.effects[0] == 'coulomb_friction'
    assert found.model['coulomb_friction.tau_c'] > 0.9 * 2.5e-3 * 4.0 / 0.018
    assert not any('The data may be to blame' in r for r in found.reasons)


def chains(most: float, scored_from: int = 0):
    """Return chains of a stretch whose speed swings that far, and further before it counts."""
    speed = most * np.sin(0.1 * np.arange(400))
    speed[:scored_from] *= 10.0
    record = Record(DT * np.arange(400), {'speed': speed}, {'speed': 'rad/s'})
    return [(SimpleNamespace(record=record, scored=True, scored_from=scored_from),)]


def test_held_out_data_that_go_much_further_are_told_with_how_far():
    (said,) = beyond_training(chains(10.0), chains(20.0))
    assert 'speed to 20 rad/s (training: 10)' in said
    assert beyond_training(chains(10.0), chains(14.0)) == ()
    assert beyond_training(chains(10.0), chains(14.0, scored_from=200)) == ()
