"""Profiles: values, files, families, and the filters that stand for a speed loop."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from motor_sysid.control.excitation import FAMILIES
from motor_sysid.control.experiment import run_closed
from motor_sysid.control.loop import speed_loop
from motor_sysid.control.pid import Pid
from motor_sysid.control.profile import Hold, Part, Profile, PROFILES, Ramp, Sweep, Triangle
from motor_sysid.control.profile_file import (
    dump_profile,
    load_profile,
    parse_profile,
    save_profile,
)
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model

PARTS = (
    Part(1.0, Hold(0.5)), Part(2.0, Ramp(-1.0, 1.0)), Part(0.5, Triangle(0.3)),
    Part(1.5, Sweep(1.0, 1.0, 5.0)),
)  # fmt: skip
MIXED = Profile('made', 8.0, 3.0, PARTS, 'voltage', 'V')


def test_samples_are_the_values_at_their_times() -> None:
    for profile in (MIXED, *(Profile(name, 70.0, 4.0) for name in PROFILES)):
        samples = profile.sampled(0.003)
        assert samples.tolist() == [profile(0.003 * k) for k in range(samples.size)]
        assert samples.size == np.ceil(profile.duration / 0.003)
    assert MIXED(0.0) == 4.0
    assert MIXED(1.2) == pytest.approx(0.0, abs=1e-12), 'the middle of the ramp'
    assert MIXED(-1e-9) == MIXED(3.0) == 0.0


def test_yaml_is_the_same_profile_and_keeps_limits(tmp_path: Path) -> None:
    path = tmp_path / 'a.yaml'
    save_profile(MIXED, path, limits={'speed': 90.0, 'travel': np.inf}, note='why')
    read, limits = load_profile(path)
    assert limits == {'speed': 90.0}
    assert (read.name, read.signal, read.unit) == ('made', 'voltage', 'V')
    np.testing.assert_allclose(read.sampled(0.001), MIXED.sampled(0.001), atol=1e-9)


def test_csv_holds_the_samples(tmp_path: Path) -> None:
    path = tmp_path / 'a.csv'
    save_profile(MIXED, path, dt=0.01)
    read, limits = load_profile(path)
    assert (limits, read.signal) == ({}, 'voltage')
    assert read.duration == pytest.approx(3.0)
    halfway = [read(t + 0.005) for t in 0.01 * np.arange(300)]
    np.testing.assert_array_equal(halfway, MIXED.sampled(0.01))


def test_the_time_of_a_table_may_be_in_any_unit_of_time(tmp_path: Path) -> None:
    path = tmp_path / 'a.csv'
    for title, times in (('s', (0, 0.01, 0.03)), ('ms', (5, 15, 35)), ('us', (0, 1e4, 3e4))):
        rows = [f'{time:g},{value}' for time, value in zip(times, (1, 2, 3), strict=True)]
        path.write_text('\n'.join([f'time [{title}],voltage [V]', *rows]))
        read, _ = load_profile(path)
        assert read.duration == pytest.approx(0.05)
        assert [read(t) for t in (0.005, 0.02, 0.04)] == [1.0, 2.0, 3.0]


BAD = (
    ('signal', 'thrust', 'unknown signal `thrust`'),
    ('unit', 'mV', 'its unit is V'),
    ('schema', 'x', 'expected .motor_sysid/profile/1.'),
    ('parts', [], 'needs `parts`'),
    ('parts', [{'shape': 'spiral', 'seconds': 1}], 'part 1: `shape` must be one of hold'),
    ('parts', [{'shape': 'hold', 'seconds': 1}], 'a hold has shape, seconds, level'),
    ('parts', [{'shape': 'hold', 'seconds': 0, 'level': 1}], 'must be positive'),
    ('parts', [{'shape': 'hold', 'seconds': 1, 'level': 'up'}], "'up' is not a finite number"),
    ('limits', {'torque': 1.0}, 'may name input, speed, current, travel'),
    ('limits', {'speed': -1.0}, 'must be positive'),
)


@pytest.mark.parametrize(('key', 'value', 'message'), BAD)
def test_bad_files_are_refused_with_the_reason(key: str, value: object, message: str) -> None:
    content = yaml.safe_load(dump_profile(MIXED)) | {key: value}
    with pytest.raises(UserError, match=message):
        parse_profile(yaml.safe_dump(content))


@pytest.mark.parametrize(
    'text', ['', '0,1\n', 'time [s],voltage [V]\n0,1\n', 'time [s],voltage [V]\n0,a\n1,2\n',
             'time [s],voltage [V]\n1,1\n0,2\n', 'time [V],voltage [V]\n0,1\n1,2\n',
             'time [sol],voltage [V]\n0,1\n1,2\n'],
)  # fmt: skip
def test_bad_tables_are_refused_by_name(text: str, tmp_path: Path) -> None:
    (tmp_path / 'p.csv').write_text(text)
    with pytest.raises(UserError, match=r'p\.csv'):
        load_profile(tmp_path / 'p.csv')


@pytest.mark.parametrize('family', FAMILIES.values(), ids=lambda f: f.key)
def test_every_family_keeps_its_level_and_rests_at_both_ends(family) -> None:
    assert family.as_speed or family.as_input
    for repeats in (1, 3):
        values = family.profile('voltage', 'V', 7.0, 5.0, repeats).sampled(1e-3)
        assert values.size == 5000
        assert np.max(np.abs(values)) <= 7.0 + 1e-12
        assert not np.any(values[:200])
        assert not np.any(values[-200:])
        assert (values.min() < 0 < values.max()) == family.reverses


@pytest.mark.parametrize('kind', ['brushed_dc', 'brushed_dc_reduced', 'mechanical_axis'])
def test_the_filters_are_the_loop_that_the_controller_makes(kind: str) -> None:
    """On a linear motor: no friction that would have to be found in rounds."""
    model, dt = Model.base(kind), 1e-3
    loop = speed_loop(model, dt)
    reference = Profile('steps', 20.0, 1.0).sampled(dt)
    record = run_closed(model, reference, Pid(loop.gains), dt, lambda plant: plant.outputs)
    name = model.kind.inputs[0][0]
    u = loop.answer(reference)
    np.testing.assert_allclose(u, record[name], atol=1e-6 * np.max(np.abs(u)))
    np.testing.assert_allclose(loop.speed(u), record['speed'], atol=1e-4)
