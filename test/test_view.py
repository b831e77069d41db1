"""The view: what the page is told, against numpy."""

from base64 import b64decode
from dataclasses import replace
import hashlib
from itertools import pairwise
import json
from pathlib import Path

from fake_diagnosis import build_diagnosis
import fake_variants
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.errors import UserError
from motor_sysid.physics.parameters import Parameter
from motor_sysid.signals.record import Provenance, Record
from motor_sysid.signals.short_names import short_names
from motor_sysid.workbench.axis import bucket_points, bucket_size, decimate, lay_out
from motor_sysid.workbench.bench import Bench
from motor_sysid.workbench.regimes import FEWEST, REGIMES
from motor_sysid.workbench.report import asset, report_html, SCRIPTS, STYLES, write_view_report
from motor_sysid.workbench.schema import View
from motor_sysid.workbench.view import build_view, load_view, save_view
from motor_sysid.workbench.words import recordings

VARIANTS = (
    'several_records', 'many_records', 'linear_axis', 'three_phases', 'awkward', 'tiny',
    'unknown_shape',
)  # fmt: skip


def unpack(text: str, kind: str = '<f4') -> np.ndarray:
    return np.frombuffer(b64decode(text), dtype=kind)


@pytest.fixture(scope='module')
def diagnosis() -> Diagnosis:
    return build_diagnosis(20.0)


@pytest.fixture(scope='module')
def view(diagnosis: Diagnosis) -> View:
    return build_view(diagnosis)


@given(st.integers(2, 5000), st.integers(2, 400), st.integers(0, 4999))
def test_decimation_keeps_every_spike(samples: int, points: int, where: int) -> None:
    values = np.sin(np.arange(samples))
    values[where % samples] = 77.0
    values[(where * 7 + 1) % samples] = -55.0
    size = bucket_size(samples, points)
    kept = decimate(values, size)
    assert kept.max() == values.max()
    assert kept.min() == values.min()
    assert kept.shape == bucket_points(samples, size).shape
    assert kept.size <= max(points, 4) + 4
    assert np.all(np.diff(bucket_points(samples, size)) > 0)


def test_decimation_passes_over_what_is_not_finite() -> None:
    values = np.array([np.nan, 3.0, np.inf, -1.0, np.nan, np.nan])
    assert decimate(values, 2).tolist()[:4] == [3.0, 3.0, -1.0, -1.0]
    assert np.isnan(decimate(values, 2)[4:]).all()


@pytest.mark.parametrize('name', VARIANTS)
def test_every_view_is_strict_json_and_its_arrays_agree(name: str) -> None:
    view = build_view(getattr(fake_variants, name)())
    assert json.loads(json.dumps(view, allow_nan=False)) == view
    time = unpack(view['time'], '<f8')
    assert np.all(np.diff(time) > 0)
    for channel in view['channels']:
        assert unpack(channel['values']).size == time.size
    for step in view['steps']:
        for packed in (*step['model'].values(), *step['error'].values()):
            assert unpack(packed).size == time.size


def test_the_same_diagnosis_gives_the_same_page(diagnosis: Diagnosis, view: View) -> None:
    assert report_html(build_view(diagnosis)) == report_html(view)


def test_held_out_stretch_is_in_focus_and_follows_the_training(view: View) -> None:
    train, valid = view['records']
    assert view['focus'] == [valid['start'], valid['end']]
    assert valid['start'] == pytest.approx(train['end'] + 1e-3)
    assert valid['clock'] == train['clock'] == 0.0
    assert view['held_out'] == 'held out: last 4 s'


def test_stretches_of_one_recording_keep_its_clock_among_others() -> None:
    whole = fake_variants.several_records()
    sources = [replace(r, provenance=Provenance('one.csv')) for r in whole.records]
    sources[1] = replace(sources[1], provenance=Provenance('two.csv'))
    records = build_view(replace(whole, records=tuple(sources)))['records']
    own = [record['start'] - record['clock'] for record in records]
    assert own == pytest.approx([0.0, 0.0, 16.0], abs=1e-6)  # the third is the end of the first
    assert records[1]['end'] < records[2]['start']


def test_separate_records_follow_with_a_gap_and_their_own_clock() -> None:
    view = build_view(fake_variants.several_records())
    first, second, third = view['records']
    assert [r['label'] for r in view['records']] == ['train_1.csv', 'train_2.csv', 'valid.csv']
    assert first['end'] < second['start'] < second['end'] < third['start']
    assert third['clock'] == third['start']
    assert view['held_out'] == 'held out: valid.csv (4 s)'
    assert view['first'] == 2  # something unknown remains: the page opens with the last model


@pytest.mark.parametrize('count', [2, 20, 100])
@pytest.mark.parametrize('role', ['train', 'validate'])
def test_nearly_all_of_what_is_drawn_is_data(count: int, role: str) -> None:
    time = np.arange(0, 10, 0.02)
    records = [
        Record(time, {'speed': 0 * time}, {'speed': 'rad/s'}, Provenance(f'{k}.csv'))
        for k in range(count)
    ]
    parts = [record.split(0.2) for record in records]
    held = lay_out([r for two in zip(*parts, strict=True) for r in two],
                   ['train'] * count + ['validate'] * count, 6000)[count:]  # fmt: skip
    whole = lay_out(records, [role] * count, 6000)
    for stretches in (held, whole):
        shown = sum(s.end - s.start for s in stretches)
        assert shown > 0.97 * (stretches[-1].end - stretches[0].start)
        assert all(a.end < b.start for a, b in pairwise(stretches))


@pytest.mark.parametrize(
    ('count', 'words'),
    [(4, 'a/1.csv, a/2.csv, a/3.csv, a/4.csv'), (5, '5 recordings: a/1.csv, a/2.csv, ...')],
)
def test_many_recordings_are_counted(count: int, words: str) -> None:
    assert recordings([f'a/{k + 1}.csv' for k in range(count)]) == words


def from_sources(*sources: str) -> View:
    """Return the view of records of these sources, the last of which is held out."""
    whole = fake_variants.several_records()
    records = tuple(
        replace(record, provenance=Provenance(source))
        for record, source in zip(whole.records, sources, strict=True)
    )
    differences = (fake_variants.of_the_load(sources),)
    return build_view(replace(whole, records=records, differences=differences))


def test_records_of_one_file_name_are_told_apart_by_their_folders() -> None:
    view = from_sources('logs/d1/run.csv', 'logs/d2/run.csv', 'logs/d3/run.csv')
    names = ['d1/run.csv', 'd2/run.csv', 'd3/run.csv']
    assert [r['label'] for r in view['records']] == names
    assert view['source'] == 'd1/run.csv, d2/run.csv, d3/run.csv'
    assert view['held_out'] == 'held out: d3/run.csv (4 s)'
    (one,) = view['verdict']['differences']
    assert [each['record'] for each in one['values']] == names


def test_what_is_held_out_is_the_last_of_a_recording_or_another_one() -> None:
    assert from_sources('a/x.csv', 'b/x.csv', 'b/x.csv')['held_out'] == 'held out: last 4 s'
    assert from_sources('a/x.csv', 'b/x.csv', 'x.csv')['held_out'] == 'held out: x.csv (4 s)'


@pytest.mark.parametrize(
    ('sources', 'names'),
    [
        (['a/run.csv'], ['run.csv']),
        (['a/1/x.csv', 'a/2/x.csv', 'y.csv'], ['1/x.csv', '2/x.csv', 'y.csv']),
        (['x.csv', 'a/x.csv', '/b/a/x.csv'], ['x.csv', 'a/x.csv', 'b/a/x.csv']),
        (['', 'x.csv'], ['record', 'x.csv']),
    ],
)
def test_names_are_as_short_as_they_can_be(sources: list[str], names: list[str]) -> None:
    assert list(short_names(sources).values()) == names


def test_errors_are_measured_minus_model(diagnosis: Diagnosis, view: View) -> None:
    record, prediction = diagnosis.records[1], diagnosis.steps[1].predictions[1]
    error = record['speed'] - prediction['speed']
    sent = unpack(view['steps'][1]['error']['speed'])[-bucket_of(view, diagnosis) :]
    assert sent.max() == pytest.approx(error.max(), rel=1e-6)
    assert sent.min() == pytest.approx(error.min(), rel=1e-6)


def bucket_of(view: View, diagnosis: Diagnosis) -> int:
    time = unpack(view['time'], '<f8')
    return int(np.sum(time >= view['records'][1]['start']))


def test_shares_of_error_and_time_sum_to_one(view: View) -> None:
    for step in view['steps']:
        assert [r['name'] for r in step['regimes']] == list(REGIMES)
        assert sum(r['error_share'] or 0 for r in step['regimes']) == pytest.approx(1, abs=1e-5)
        assert sum(r['time_share'] or 0 for r in step['regimes']) == pytest.approx(1, abs=1e-5)


def test_shares_are_those_of_the_error_that_the_ladder_shows(
    diagnosis: Diagnosis, view: View
) -> None:
    bench = Bench.of(diagnosis)
    assert bench.regimes is not None
    held = diagnosis.records[1]
    for k, step in enumerate(diagnosis.steps):
        parts = [
            (held[name] - step.predictions[1][name]) ** 2 / np.mean(held[name] ** 2)
            for name in step.channel_errors
        ]
        squares = np.mean(parts, axis=0)
        assert 100 * np.sqrt(squares.mean()) == pytest.approx(step.validation_error_percent)
        for n, regime in enumerate(view['steps'][k]['regimes']):
            share = squares[bench.regimes[1] == n].sum() / squares.sum()
            assert regime['error_share'] == pytest.approx(share, abs=1e-6)


def test_regimes_follow_speed(diagnosis: Diagnosis) -> None:
    bench = Bench.of(diagnosis)
    assert bench.regimes is not None
    record, bins = diagnosis.records[0], bench.regimes[0]
    speed = np.abs(record['speed'])
    assert speed[bins == 0].max() < speed[bins == 1].max() < speed[bins == 3].max()
    steps = np.flatnonzero(np.abs(np.diff(record['voltage'])) > 3)
    assert np.mean(bins[steps + 10] == 2) > 0.8  # after a step of voltage the motor accelerates


def test_map_is_the_rms_error_of_each_cell_in_sigmas(diagnosis: Diagnosis, view: View) -> None:
    assert view['map'] is not None
    speed, current = (diagnosis.records[1][name] for name in ('speed', 'current'))
    error = speed - diagnosis.steps[0].predictions[1]['speed']
    values, counts = unpack(view['steps'][0]['map'] or ''), unpack(view['map']['counts'], '<u4')
    columns = len(view['map']['x_edges']) - 1
    assert counts.sum() == len(speed)
    cell = int(np.nanargmax(np.where(counts >= FEWEST, values, np.nan)))
    x, y = view['map']['x_edges'], view['map']['y_edges']
    column, row = cell % columns, cell // columns
    if not (0 < column < columns - 1 and 0 < row < len(y) - 2):
        pytest.skip('the worst cell is an outer one, which holds what lies beyond it too')
    inside = (speed >= x[column]) & (speed < x[column + 1])
    inside &= (current >= y[row]) & (current < y[row + 1])
    assert np.sum(inside) == pytest.approx(counts[cell], abs=1)
    rms = np.sqrt(np.mean(error[inside] ** 2)) / 0.35
    assert values[cell] == pytest.approx(rms, rel=0.02)
    assert np.isnan(values[counts < FEWEST]).all()


def test_a_spike_of_current_does_not_stretch_the_map(diagnosis: Diagnosis) -> None:
    record = diagnosis.records[1]
    current = record['current'].copy()
    current[100] = 1e4
    spoilt = record.with_signal('current', current, 'A')
    spiked = replace(diagnosis, records=(diagnosis.records[0], spoilt))
    view = build_view(spiked)
    assert view['map'] is not None
    assert view['map']['y_edges'][-1] < 20


def test_parameters_tell_how_they_changed_from_the_base(view: View) -> None:
    assert all(p['base'] is None for p in view['steps'][0]['parameters'])
    b = next(p for p in view['steps'][1]['parameters'] if p['name'] == 'b')
    assert b['base'] == pytest.approx(2.4e-4)
    assert not b['on_bound']
    new = next(p for p in view['steps'][1]['parameters'] if p['effect'] == 'Coulomb friction')
    assert (new['name'], new['base']) == ('tau_c', None)


def test_the_candidate_that_was_taken_is_marked(view: View) -> None:
    added = [[c['effect'] for c in s['candidates'] if c['added']] for s in view['steps']]
    assert added == [['coulomb_friction'], ['cogging_torque'], []]
    assert [[e['key'] for e in s['added']] for s in view['steps']] == [[], *added[:2]]


def test_verdict_in_words(diagnosis: Diagnosis) -> None:
    def title(verdict: Verdict) -> str:
        return build_view(replace(diagnosis, verdict=verdict))['verdict']['title']

    assert title(Verdict.EFFECT_MISSING) == 'Missing: Coulomb friction and cogging torque'
    assert title(Verdict.COMPLETE) == 'Nothing is missing'
    assert len({title(verdict) for verdict in Verdict}) == len(Verdict)


def test_panels_group_phases_and_put_the_primary_first() -> None:
    view = build_view(fake_variants.three_phases())
    panels = {p['key']: p['channels'] for p in view['panels']}
    assert list(panels) == ['speed', 'current', 'voltage']
    assert panels['current'] == ['current_a', 'current_b', 'current_c']
    assert [c['label'] for c in view['channels'] if c['key'].startswith('voltage')] == list('abc')


def test_records_that_differ_are_what_is_told_first() -> None:
    found = fake_variants.several_records()
    verdict = build_view(found)['verdict']
    assert verdict['title'].endswith('not of one motor and supply; nothing else is missing')
    (one,) = verdict['differences']
    assert (one['name'], one['unit']) == ('constant_load_torque.tau_l', 'N m')
    assert [each['value'] for each in one['values']] == [1e-3, 4e-3, 1.1e-3]
    assert [each['searched'] for each in one['values']] == [True, False, True]
    more = replace(found, unknown=fake_variants.unknown_shape().unknown)
    assert build_view(more)['verdict']['title'].endswith('not of one motor and supply')
    alike = build_view(replace(found, differences=()))['verdict']
    assert alike['differences'] == []
    assert alike['title'].startswith('Something is missing')


def test_what_is_unknown_and_where_it_fails_reach_the_page() -> None:
    found = fake_variants.unknown_shape()
    view = build_view(found)
    first, quiet = view['verdict']['unknown']
    assert (first['axis'], first['axes'][0]['best'], quiet['curve']) == ('speed', True, None)
    assert first['curve'] is not None
    assert unpack(first['curve']['mean']).size == found.steps[0].curves[0].x.size
    assert view['verdict']['blind_spots'] == [
        {'words': 'It turns one way only.', 'remedy': 'record both'}
    ]
    step = view['steps'][0]
    assert [layer['quantity'] for layer in step['maps']][-1] == 'unexplained torque'
    drawn = step['maps'][-1]
    assert unpack(drawn['value']).size == (len(drawn['x_edges']) - 1) * (len(drawn['y_edges']) - 1)
    speed = step['where'][0]['channels']['speed']
    assert (speed['overall'], speed['rms'][3], speed['low'][0]) == (1.1, None, 0.24)
    assert [c['chance'] for c in step['curves']] == [1e-9, 0.4, None]


def test_a_linear_axis_shows_position_in_metres_and_force() -> None:
    view = build_view(fake_variants.linear_axis())
    assert view['primary'] == 'position'
    assert [(p['title'], p['unit'], p['shown']) for p in view['panels']] == [
        ('position', 'm', True),
        ('force', 'N', True),
    ]
    assert view['map'] is not None
    assert (view['map']['x_unit'], view['map']['y']) == ('m/s', 'force')


def test_a_view_that_is_not_whole_or_has_no_numbers_is_refused(view: View, tmp_path: Path) -> None:
    path = tmp_path / 'view.json'
    text = save_view(view, path).read_text()
    path.write_text(json.dumps({**json.loads(text), 'steps': []}))
    with pytest.raises(UserError, match='is no whole view: it lacks steps'):
        load_view(path)
    path.write_text(text[:-1] + ', "more": NaN}')
    with pytest.raises(UserError, match='NaN is no number of JSON'):
        load_view(path)


def test_a_model_that_ran_away_has_no_share_of_an_error(diagnosis: Diagnosis) -> None:
    first = diagnosis.steps[0]
    away = tuple({n: np.full_like(v, np.inf) for n, v in p.items()} for p in first.predictions)
    gone = replace(diagnosis, steps=(replace(first, predictions=away), *diagnosis.steps[1:]))
    shares = build_view(gone)['steps'][0]['regimes']
    assert shares
    assert all(one['error_share'] is None for one in shares)


def test_a_value_is_never_on_a_bound_that_is_infinitely_far() -> None:
    def on_bound(value: float, lower: float, upper: float) -> bool:
        return Parameter('a', 'N m', value, lower, upper, '').on_bound

    assert not on_bound(0.1, -np.inf, np.inf)
    assert not on_bound(0.1, 0.0, np.inf)
    assert on_bound(0.0, 0.0, np.inf)
    assert on_bound(1.0, -np.inf, 1.0)


def test_a_saved_view_comes_back(view: View, tmp_path: Path) -> None:
    path = save_view(view, tmp_path / 'deep' / 'report.json')
    assert load_view(path) == view
    page = write_view_report(load_view(path), tmp_path / 'report.html')
    assert page.read_text(encoding='utf-8') == report_html(view)


def test_what_is_no_view_is_refused(tmp_path: Path) -> None:
    for text in ('', '[]', '{"schema": "motor_sysid/diagnosis/1"}', '\x00'):
        path = tmp_path / 'bad.json'
        path.write_text(text)
        with pytest.raises(UserError, match='view'):
            load_view(path)
    with pytest.raises(UserError, match='cannot read'):
        load_view(tmp_path / 'absent.json')


def test_nothing_to_show_is_said_so(diagnosis: Diagnosis) -> None:
    with pytest.raises(UserError, match='nothing to show'):
        build_view(replace(diagnosis, records=(), roles=()))


def test_a_long_record_stays_small() -> None:
    page = report_html(build_view(build_diagnosis(60.0)))
    assert 300_000 < len(page.encode()) < 1_000_000


def test_hostile_names_cannot_leave_the_data_block() -> None:
    page = report_html(build_view(fake_variants.awkward()))
    assert 'onerror=alert(1)>' in page
    assert '</script><img' not in page
    assert page.count('<script') == len(SCRIPTS) + 1


def test_the_page_names_no_address_to_fetch_from() -> None:
    own = [asset(n) for n in (*STYLES, *SCRIPTS, 'index.html') if not n.startswith('uPlot')]
    for text in own:
        assert 'http://' not in text.replace('http://www.w3.org/2000/svg', '')
        assert 'https://' not in text


def test_vendored_plot_library_is_the_published_one() -> None:
    sums = {
        'uPlot.iife.min.js': '19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f',
        'uPlot.min.css': 'df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04',
        'uPlot.LICENSE': '8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd',
    }
    for name, expected in sums.items():
        assert hashlib.sha256(asset(name).encode()).hexdigest() == expected
