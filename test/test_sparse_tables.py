"""A table in which signals have rows of their own costs no rows."""

from pathlib import Path

import numpy as np
import pytest

from motor_sysid.recording import load

COUNT, DT = 2000, 1e-3
TIME = DT * np.arange(COUNT)
VOLTS = np.where(np.arange(COUNT) // 100 % 2, 6.0, -6.0)
SPEED = 100 * np.sin(3 * TIME)
HEADS = 'time [s]', 'voltage [V]', 'current [A]', 'speed [rad/s]'


def written(path: Path, *columns: np.ndarray, heads: tuple[str, ...] = HEADS) -> Path:
    """Write a table whose cells are empty where a value is none."""
    table = np.column_stack(columns)
    rows = [','.join('' if np.isnan(v) else f'{v:.17g}' for v in row) for row in table]
    path.write_text('\n'.join([','.join(heads), *rows]) + '\n')
    return path


def only(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return values of some rows, nothing in the others."""
    return np.where(rows, values, np.nan)


def test_slow_columns_are_kept_as_they_were_sampled(tmp_path: Path) -> None:
    slow = np.arange(COUNT) % 10 == 3
    path = written(tmp_path / 'a.csv', TIME, VOLTS, 0.1 * VOLTS, only(SPEED, slow))
    loaded = load(path)
    (record,) = loaded.records
    assert {finding.code for finding in loaded.findings} == {'topics_joined'}
    assert record.time == pytest.approx(TIME[3 : COUNT - 6])
    assert np.array_equal(record['voltage'], VOLTS[3 : COUNT - 6])
    own = record.samples['speed']
    assert own.time == pytest.approx(TIME[slow])
    assert own.values == pytest.approx(SPEED[slow])
    assert record['speed'] == pytest.approx(SPEED[3 : COUNT - 6], abs=0.02)
    assert 'current' not in record.samples


@pytest.mark.parametrize('start', [0.0, 5.0, 1.7e9])
def test_a_row_for_every_message_is_no_hole(tmp_path: Path, start: float) -> None:
    """Voltage at 1 kHz, current 0.3 ms and speed 0.6 ms later: no row has all."""
    late = np.concatenate([TIME, TIME + 3e-4, TIME + 6e-4])
    order = np.argsort(late)
    which = np.repeat([0, 1, 2], COUNT)[order]
    values = np.concatenate([VOLTS, 0.1 * VOLTS, SPEED])[order]
    columns = [only(values, which == k) for k in range(3)]
    path = written(tmp_path / 'a.csv', late[order] + start, *columns)
    (record,) = load(path).records
    assert len(record) == COUNT - 1
    first = record.time[0]
    assert first == pytest.approx(start + DT if start < 10 else 0.0, abs=1e-6)
    assert np.array_equal(record['voltage'], VOLTS[1:])
    own = record.samples['current']
    assert own.time[:2] - first == pytest.approx([-7e-4, 3e-4], abs=1e-6)
    assert own.values[:2] == pytest.approx(0.1 * VOLTS[:2])


def test_values_that_are_missing_by_chance_still_cost_their_rows(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    there = rng.uniform(size=COUNT) > 0.05
    path = written(tmp_path / 'a.csv', TIME, VOLTS, 0.1 * VOLTS, only(SPEED, there))
    loaded = load(path)
    assert 'missing_values' in {finding.code for finding in loaded.findings}
    assert sum(map(len, loaded.records)) == np.sum(there)
    assert not any(record.samples for record in loaded.records)


def test_an_input_that_is_written_when_it_changes_is_held(tmp_path: Path) -> None:
    changes = np.diff(VOLTS, prepend=0.0) != 0
    path = written(tmp_path / 'a.csv', TIME, only(VOLTS, changes), 0.1 * VOLTS, SPEED)
    (record,) = load(path).records
    assert np.array_equal(record['voltage'], VOLTS)
    assert not record.samples


@pytest.mark.parametrize('swapped', [1, 20, COUNT // 3])
def test_rows_that_overtook_each_other_cost_none(tmp_path: Path, swapped: int) -> None:
    slow, order = np.arange(COUNT) % 10 == 3, np.arange(COUNT)
    for k in np.linspace(100, COUNT - 100, swapped).astype(int):
        order[[k, k + 1]] = order[[k + 1, k]]
    columns = TIME, VOLTS, 0.1 * VOLTS, only(SPEED, slow)
    path = written(tmp_path / 'a.csv', *(column[order] for column in columns))
    (record,) = load(path).records
    assert record.time == pytest.approx(TIME[3 : COUNT - 6])


def test_two_runs_in_one_table_are_two_records(tmp_path: Path) -> None:
    slow = np.arange(COUNT) % 10 == 3
    columns = TIME, VOLTS, 0.1 * VOLTS, only(SPEED, slow)
    path = written(tmp_path / 'a.csv', *(np.tile(column, 2) for column in columns))
    loaded = load(path)
    assert [len(record) for record in loaded.records] == [COUNT - 9, COUNT - 9]
    assert 'time_jumps_back' in {finding.code for finding in loaded.findings}
