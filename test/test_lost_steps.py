"""Where samples are lost just as the input steps, a record begins anew."""

import numpy as np
import pytest

from motor_sysid.recording import load
from motor_sysid.recording.lost_steps import after_lost_steps

N = 2000
TIME = 1e-3 * np.arange(N)
STEPS = np.where(np.arange(N) // 250 % 2 == 0, 3.0, -2.0)
SWEEP = 4.0 * np.sin(2 * np.pi * TIME)
NOISE = np.random.default_rng(6).normal(size=N)


def without(*lost: int) -> np.ndarray:
    """Return which rows are left."""
    return ~np.isin(np.arange(N), lost)


@pytest.mark.parametrize(
    ('volts', 'kept', 'time', 'expected'),
    [
        (STEPS, without(250), TIME, [251]),
        (STEPS, without(249, 250, 700), TIME, [251]),
        (STEPS, without(250, 999, 1000), TIME, [251, 1001]),
        (STEPS, without(240, 260), TIME, []),
        (SWEEP, without(250, 500, 501), TIME, []),
        (SWEEP + STEPS, without(500, 501, 750), TIME, [502, 751]),
        (STEPS + NOISE, without(250), TIME, []),
        (STEPS, without(250), TIME + 4e-4 * np.sin(7.0 * np.arange(N)), []),
        (STEPS, without(*range(2, N, 3)), TIME, []),
        (np.full(N, 3.0), without(250), TIME, []),
    ],
    ids=[
        'one', 'two in a row', 'two steps', 'beside a step', 'a sweep', 'steps of a sweep',
        'a noisy input', 'stamps that scatter', 'seldom sampled', 'constant',
    ],
)  # fmt: skip
def test_only_a_hole_in_which_the_input_steps_is_a_lost_step(volts, kept, time, expected):
    found = after_lost_steps(time[kept], {'voltage': volts[kept], 'speed': 9.0 * STEPS[kept]})
    assert np.flatnonzero(kept)[found].tolist() == expected


def test_what_is_measured_may_jump_in_a_hole():
    kept = without(250)
    assert not after_lost_steps(TIME[kept], {'speed': STEPS[kept]}).size


def test_a_file_is_split_there_and_says_so(tmp_path):
    path, kept = tmp_path / 'run.csv', without(250, 700, 999, 1000)
    rows = np.column_stack([TIME, STEPS, 0.1 * STEPS + 0.01 * NOISE])[kept]
    head = 'time [s],voltage [V],current [A]'
    np.savetxt(path, rows, delimiter=',', header=head, comments='')
    found = load(path)
    assert [len(record) for record in found.records] == [250, 747, 999]
    assert found.records[1].time[0] == pytest.approx(0.251)
    (finding,) = (f for f in found.findings if f.code == 'lost_step')
    assert finding.numbers == {'holes': 2}
    assert 'before 0.251 s' in finding.message


def test_no_piece_is_a_stub(tmp_path):
    """Nine rows before a step that is lost stay with what follows."""
    path, kept = tmp_path / 'run.csv', without(250, 500)
    rows = np.column_stack([TIME, STEPS])[kept][241:]
    np.savetxt(path, rows, delimiter=',', header='time [s],voltage [V]', comments='')
    found = load(path)
    assert [len(record) for record in found.records] == [258, 1499]
