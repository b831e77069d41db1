"""The report in a real browser: offline, without errors, seen to work."""

from base64 import b64decode
from collections.abc import Iterator
from dataclasses import replace
import os
from pathlib import Path
import re
from typing import TYPE_CHECKING

from fake_diagnosis import build_diagnosis
import fake_variants
import numpy as np
import pytest

from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.signals.record import Provenance
from motor_sysid.workbench.report import write_report, write_view_report
from motor_sysid.workbench.schema import View
from motor_sysid.workbench.view import build_view

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytest.importorskip('playwright.sync_api')

SIZES = ((1600, 1000), (1280, 800), (820, 1180), (390, 844), (320, 640))
VARIANTS = (
    'several_records', 'many_records', 'linear_axis', 'three_phases', 'awkward', 'tiny',
    'unknown_shape',
)  # fmt: skip


@pytest.fixture(scope='module')
def diagnosis() -> Diagnosis:
    return build_diagnosis(20.0)


@pytest.fixture(scope='module')
def view(diagnosis: Diagnosis) -> View:
    return build_view(diagnosis)


@pytest.fixture(scope='module')
def report(view: View, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_view_report(view, tmp_path_factory.mktemp('report') / 'report.html')


class Watched:
    """A page that remembers what went wrong and what it asked for."""

    def __init__(
        self, browser: 'Browser', path: Path, fragment: str = '', **options: object
    ) -> None:
        options = {'viewport': {'width': 1600, 'height': 1000}, 'offline': True, **options}
        self.context = browser.new_context(**options)
        self.page = self.context.new_page()
        self.trouble: list[str] = []
        self.requests: list[str] = []
        self.page.on('console', lambda message: self.trouble.append(message.text))
        self.page.on('pageerror', lambda error: self.trouble.append(str(error)))
        self.page.on('request', lambda request: self.requests.append(request.url))
        self.page.goto(f'{path.as_uri()}{fragment}')
        self.page.wait_for_selector('body[data-ready]')

    def ranges(self) -> np.ndarray:
        return np.array(self.page.evaluate('page.traces.ranges()'))

    def text(self, selector: str) -> str:
        return str(self.page.inner_text(selector))


@pytest.fixture
def opened(chromium: 'Browser', report: Path) -> Iterator[Watched]:
    """Return the report, open; nothing may have gone wrong by the end."""
    watched = Watched(chromium, report)
    yield watched
    assert watched.trouble == []
    assert watched.requests == [report.as_uri()]
    watched.context.close()


def unpack(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(b64decode(text), dtype=kind)


def test_it_says_what_the_view_says(opened: Watched, view: View) -> None:
    headline = opened.text('#headline')
    assert view['verdict']['title'] in headline
    for step in (view['steps'][0], view['steps'][-1]):
        assert f'{step["validation_error_percent"]:.2g} %' in headline
    assert 'low speed' in opened.text('#now') or 'regimes' in opened.text('#now')
    rows = opened.page.query_selector_all('#model-table tbody tr')
    for row, step in zip(rows, view['steps'], strict=True):
        assert f'{step["validation_error_percent"]:.3g}' in row.inner_text()
    assert opened.page.title() == 'motor_sysid report · hidden_friction.mcap'
    assert 'last 4 s' in opened.text('#source')


def test_stepping_through_the_models_shows_the_error_fall(opened: Watched, view: View) -> None:
    page = opened.page
    errors = [f'{step["validation_error_percent"]:.2g} %' for step in view['steps']]
    assert errors[0] in opened.text('#now')
    page.check('#stepper input[value="1"]', force=True)
    assert errors[1] in opened.text('#now')
    assert opened.text('[role=status]').startswith('M0 → M1')
    page.keyboard.press('ArrowRight')  # the radio buttons' own key
    assert errors[2] in opened.text('#now')
    page.click('#back')
    assert errors[1] in opened.text('#now')
    page.click('#headline')
    page.keyboard.press('n')
    assert errors[2] in opened.text('#now')
    page.keyboard.press('p')
    page.keyboard.press('p')
    assert errors[0] in opened.text('#now')
    assert page.is_disabled('#back')
    assert page.evaluate('location.hash') == '#M0'


def test_keys_work_after_a_click_on_a_model_or_a_panel(opened: Watched) -> None:
    page = opened.page
    for selector in ('#stepper label:has-text("M0")', '#panels label:has-text("position")'):
        page.click(selector)
        page.keyboard.press('n')
        assert page.evaluate('page.step') == 1
        before = opened.ranges()[0]
        page.keyboard.press('+')
        assert np.ptp(opened.ranges()[0]) < np.ptp(before)
        page.keyboard.press('0')
        assert opened.ranges()[0] == pytest.approx(before)
        page.keyboard.press('p')
        assert page.evaluate('page.step') == 0
    page.keyboard.press('+')
    before = opened.ranges()[0]
    page.keyboard.press('ArrowLeft')  # a checkbox has no use for it
    assert opened.ranges()[0, 0] < before[0]
    page.click('#stepper label:has-text("M0")')
    page.keyboard.press('n')
    before = opened.ranges()[0]
    page.keyboard.press('ArrowRight')  # the radio buttons' own key, from the model shown
    assert page.evaluate('page.step') == 2
    assert opened.ranges()[0] == pytest.approx(before)


@pytest.mark.parametrize('verdict', Verdict)
def test_only_a_verdict_that_names_all_says_that_one_may_stop(
    chromium: 'Browser', diagnosis: Diagnosis, tmp_path: Path, verdict: Verdict
) -> None:
    path = write_report(replace(diagnosis, verdict=verdict), tmp_path / 'report.html')
    watched = Watched(chromium, path, '#M2')
    ends = verdict in (Verdict.COMPLETE, Verdict.EFFECT_MISSING)
    assert ('stop here' in watched.text('#now')) is ends
    assert ('stop here' in watched.text('#missing')) is ends
    assert ('No candidate of the catalogue improves it.' in watched.text('#now')) is not ends
    assert watched.page.locator('#now .ok').count() == (2 if ends else 0)
    assert watched.page.locator('#ladder .dot.ok').count() == ends
    watched.context.close()


def test_everything_follows_the_model(opened: Watched, view: View) -> None:
    page = opened.page
    page.click('#model-table tbody tr:nth-child(2) button')
    first = page.get_attribute('.candidates tbody', 'data-effect')
    assert first == view['steps'][1]['candidates'][0]['effect']
    assert 'M1' in opened.text('#parameters h2')
    assert '3.9× too large' in opened.text('#parameter-table')
    assert page.get_attribute('#model-table tr.current button', 'aria-pressed') == 'true'
    assert 'Cogging torque' in opened.text('#curves')


def test_the_ghost_is_the_error_of_the_previous_model(opened: Watched, view: View) -> None:
    page = opened.page
    page.check('#stepper input[value="1"]', force=True)
    drawn = page.evaluate(
        '() => { const shown = page.traces.lines("error"); return [shown.ghost, shown.error]; }'
    )
    for values, step in zip(drawn, view['steps'], strict=False):
        sent = unpack(step['error']['speed'], '<f4')
        assert np.array_equal(np.array(values, dtype=float), sent, equal_nan=True)
    page.select_option('#ghost', 'none')
    assert page.evaluate('page.traces.lines("error").ghost.every((v) => v === null)')


def test_the_stretch_held_out_is_in_focus_and_others_can_be_chosen(
    opened: Watched, view: View
) -> None:
    assert opened.ranges() == pytest.approx(np.tile(view['focus'], (4, 1)), abs=1e-3)
    opened.page.click('#stretches button:has-text("all")')
    assert opened.ranges()[:, 0] == pytest.approx(0)
    opened.page.click('#stretches button:has-text("training")')
    assert opened.ranges()[:, 1] == pytest.approx(view['records'][0]['end'])


def test_zoom_and_pan_move_all_panels_alike(opened: Watched, view: View) -> None:
    page = opened.page
    box = page.locator('.plot[data-panel=speed] .u-over').bounding_box()
    left, y = box['x'], box['y'] + box['height'] / 2

    def alike() -> tuple[float, float]:
        ranges = opened.ranges()
        assert np.ptp(ranges, axis=0).max() < 1e-3
        return float(ranges[0, 0]), float(ranges[0, 1])

    start, end = view['focus']
    page.mouse.move(left + 0.25 * box['width'], y)
    page.mouse.down()
    page.mouse.move(left + 0.75 * box['width'], y, steps=4)
    page.mouse.up()
    low, high = alike()
    assert low == pytest.approx(start + 0.25 * (end - start), abs=0.03)
    assert high == pytest.approx(start + 0.75 * (end - start), abs=0.03)
    page.mouse.wheel(0, -100)
    assert alike()[1] - alike()[0] == pytest.approx(0.75 * (high - low))
    low, high = alike()
    page.keyboard.down('Shift')
    page.mouse.down()
    page.mouse.move(left + 0.65 * box['width'], y, steps=4)
    page.mouse.up()
    page.keyboard.up('Shift')
    shift = 0.1 * (high - low)
    assert alike() == pytest.approx((low + shift, high + shift), abs=2e-2)
    page.focus('#plots')
    low, high = alike()
    page.keyboard.press('ArrowLeft')
    assert alike()[0] == pytest.approx(low - 0.2 * (high - low))
    page.keyboard.press('-')
    assert alike()[1] - alike()[0] > high - low
    page.keyboard.press('+')
    page.check('#stepper input[value="1"]', force=True)  # the window stays when the model changes
    assert alike()[1] - alike()[0] == pytest.approx(high - low)
    page.focus('#plots')
    page.keyboard.press('0')
    assert alike() == pytest.approx((start, end))


def test_the_cursor_tells_what_the_samples_were(
    opened: Watched, diagnosis: Diagnosis, view: View
) -> None:
    place = opened.page.locator('[data-panel="error"] .u-over').bounding_box()
    assert place is not None
    opened.page.mouse.move(place['x'] + 0.4 * place['width'], place['y'] + 20)
    opened.page.locator('[data-panel="error"] .readout', has_text='error').wait_for()
    k = opened.page.evaluate('page.traces.cursor()')
    held = view['records'][1]
    assert held['bucket'] > 1
    first = int(np.flatnonzero(unpack(view['time'], '<f8') >= held['start'] - 1e-9)[0])
    begin = (k - first) // 2 * held['bucket']
    error = diagnosis.records[1]['speed'] - diagnosis.steps[0].predictions[1]['speed']
    samples = error[begin : begin + held['bucket']]
    told = opened.page.text_content('[data-panel="error"] .readout') or ''
    numbers = [float(n) for n in re.findall(r'-?\d+\.\d+', told.replace('\u2212', '-'))]
    assert numbers == pytest.approx([samples.min(), samples.max()], rel=1e-3)
    assert re.match(r'1\d\.\d+ s · ', opened.page.text_content('.readout') or '')


def test_a_finger_reads_and_moves(chromium: 'Browser', report: Path) -> None:
    touched = Watched(chromium, report, has_touch=True, viewport={'width': 820, 'height': 1180})
    touched.page.locator('[data-panel="speed"] .u-over').tap()
    assert 'measured' in (touched.page.text_content('[data-panel="speed"] .readout') or '')
    touched.page.tap('[data-zoom="in"]')
    before = touched.ranges()
    touched.page.tap('[data-zoom="left"]')
    assert np.all(touched.ranges() < before)
    assert touched.trouble == []
    touched.context.close()


def test_paper_is_light_and_as_wide_as_the_page(chromium: 'Browser', report: Path) -> None:
    wide = {'width': 2560, 'height': 1200}
    printed = Watched(chromium, report, color_scheme='dark', viewport=wide)
    printed.page.evaluate('dispatchEvent(new Event("beforeprint"))')
    assert printed.page.evaluate('isDark()') is False
    drawn = 'Array.from(document.querySelectorAll("canvas, svg")'
    widths = f'{drawn}, (c) => c.getBoundingClientRect().right)'
    assert max(printed.page.evaluate(widths)) <= 700
    assert printed.page.evaluate('document.querySelector("#why").open') is True
    printed.page.evaluate('dispatchEvent(new Event("afterprint"))')
    assert printed.page.evaluate('isDark()') is True
    assert printed.page.evaluate('document.querySelector("#why").open') is False
    assert max(printed.page.evaluate(widths)) > 2000
    assert printed.trouble == []
    printed.context.close()


def test_a_picture_reaches_beyond_any_curve(opened: Watched) -> None:
    sizes = [10.0 ** (k / 97) for k in range(-400, 400)] + [9.85e-3, 9.9, 1.0, 1000.0]
    reaches = np.array(opened.page.evaluate('sizes => sizes.map(niceReach)', sizes), dtype=float)
    assert np.all(reaches >= 1.02 * np.array(sizes))
    assert np.all(reaches <= 1.4 * np.array(sizes))


def test_hovering_a_cell_lights_exactly_its_moments(opened: Watched, view: View) -> None:
    page = opened.page
    assert view['map'] is not None
    ids = unpack(view['map']['ids'], '<u2')
    cells = page.query_selector_all('#map rect[data-cell]')
    for cell in cells[:: max(1, len(cells) // 4)]:
        cell.hover()
        marked = page.evaluate('page.traces.marked()')
        assert marked == np.flatnonzero(ids == int(cell.get_attribute('data-cell'))).tolist()
        assert 'sensor noise' in opened.text('#tip')
    page.mouse.move(5, 5)
    assert page.evaluate('page.traces.marked()') == []
    assert page.is_hidden('#tip')


def test_a_regime_lights_its_moments_by_mouse_and_keyboard(opened: Watched, view: View) -> None:
    assert view['regimes'] is not None
    ids = unpack(view['regimes']['ids'], '<u1')
    for k in range(4):
        opened.page.hover(f'[data-regime="{k}"]')
        marked = opened.page.evaluate('page.traces.marked()')
        assert marked == np.flatnonzero(ids == k).tolist()
    opened.page.mouse.move(5, 5)
    opened.page.focus('[data-regime="1"]')
    assert opened.page.evaluate('page.traces.marked()') == np.flatnonzero(ids == 1).tolist()


def test_panels_can_be_shown_and_hidden(opened: Watched) -> None:
    page = opened.page
    names = [p.get_attribute('data-panel') for p in page.query_selector_all('.plot')]
    assert names == ['speed', 'error', 'current', 'voltage']
    page.check('#panels label:has-text("position") input')
    page.uncheck('#panels label:has-text("voltage") input')
    names = [p.get_attribute('data-panel') for p in page.query_selector_all('.plot')]
    assert names == ['speed', 'error', 'position', 'current']
    page.select_option('#error-of', 'current')
    assert 'current error [A]' in opened.text('.plot[data-panel=error]')


def test_the_error_panel_is_the_tallest(opened: Watched) -> None:
    heights = {
        p.get_attribute('data-panel'): p.bounding_box()['height']
        for p in opened.page.query_selector_all('.plot')
    }
    assert max(heights, key=lambda name: heights[name]) == 'error'


def test_a_report_offers_no_action(opened: Watched) -> None:
    assert opened.page.locator('button:has-text("Add")').count() == 0
    assert opened.page.locator('button:has-text("Remove")').count() == 0


def test_a_page_that_is_served_offers_add_and_remove(chromium: 'Browser', tmp_path: Path) -> None:
    view = build_view(build_diagnosis(5.0), effects=['coulomb_friction', 'quadratic_drag'])
    watched = Watched(chromium, write_view_report(view, tmp_path / 'live.html'), '#M2')
    assert watched.page.locator('#model-table button:has-text("Remove")').count() == 2
    assert watched.page.locator('.other option').all_inner_texts() == ['quadratic drag']
    taken = watched.page.locator('[data-effect="coulomb_friction"] button')
    watched.page.click('#back')
    watched.page.click('#back')
    assert taken.count() == 0  # M1 has it
    watched.context.close()


def test_playing_the_ladder_ends_at_the_last_model(opened: Watched) -> None:
    opened.page.click('#play')
    opened.page.wait_for_selector('#stepper input[value="2"]:checked', timeout=10_000)
    opened.page.wait_for_selector('#play:has-text("▶")')


def test_tables_tell_what_the_pictures_show(opened: Watched, view: View) -> None:
    opened.page.click('#numbers summary')
    tables = opened.text('#numbers')
    for regime in view['steps'][0]['regimes']:
        assert regime['name'] in tables
    assert 'Worst cells of the map' in tables
    assert 'Unexplained torque by position' in tables


def test_light_and_dark_follow_the_system_and_the_button(
    chromium: 'Browser', report: Path
) -> None:
    for scheme, other in (('light', 'dark'), ('dark', 'light')):
        watched = Watched(chromium, report, color_scheme=scheme)
        theme = 'document.documentElement.dataset.theme'
        assert watched.page.evaluate(theme) == scheme
        watched.page.click('#theme')
        assert watched.page.evaluate(theme) == other
        assert watched.trouble == []
        watched.context.close()


@pytest.mark.parametrize('size', SIZES)
def test_nothing_overflows_and_the_verdict_is_whole(
    chromium: 'Browser', report: Path, size: tuple[int, int]
) -> None:
    for fragment in ('', '#M2'):
        watched = Watched(chromium, report, fragment, viewport=dict(zip(
            ('width', 'height'), size, strict=True)))  # fmt: skip
        page = watched.page
        assert page.evaluate('document.documentElement.scrollWidth') <= size[0]
        for selector in ('#headline', '#now', '#why summary', '#ladder', '.steps'):
            assert page.eval_on_selector(selector, 'e => e.scrollWidth - e.clientWidth') <= 1
        if fragment == '' and size[0] >= 1280:
            for selector in ('#now', '#map', '.candidates tbody'):
                box = page.locator(selector).first.bounding_box()
                assert box['y'] + box['height'] <= size[1]
        watched.context.close()


@pytest.mark.parametrize('name', VARIANTS)
def test_other_machines_and_odd_records_are_shown_too(
    chromium: 'Browser', tmp_path: Path, name: str
) -> None:
    path = write_report(getattr(fake_variants, name)(), tmp_path / f'{name}.html')
    watched = Watched(chromium, path)
    watched.page.click('#numbers summary')
    for value in range(watched.page.locator('#stepper input').count()):
        watched.page.check(f'#stepper input[value="{value}"]', force=True)
    assert watched.trouble == []
    assert watched.requests == [path.as_uri()]
    assert not re.search(r'NaN|Infinity|undefined|null', watched.text('body'))
    assert watched.page.title().startswith('motor_sysid report')
    watched.context.close()


@pytest.mark.parametrize('width', [1600, 320])
def test_what_differs_between_records_is_drawn(
    chromium: 'Browser', tmp_path: Path, width: int
) -> None:
    path = write_report(fake_variants.several_records(), tmp_path / 'several.html')
    watched = Watched(chromium, path, viewport={'width': width, 'height': 800})
    title = 'The records are not of one motor and supply; nothing else is missing.'
    assert title in watched.text('#headline')
    box = watched.page.locator('#differences')
    caption = box.locator('figcaption').inner_text()
    assert caption.startswith('Load torque constant_load_torque.τ_l is not the same in all')
    assert 'hollow: left out of the search' in caption
    assert box.locator('circle').count() == 3
    assert box.locator('circle.hollow').count() == 1
    assert box.locator('text').all_text_contents() == [
        'train_1.csv', '1.00 mN·m', 'train_2.csv', '4.00 mN·m', 'valid.csv', '1.10 mN·m',
    ]  # fmt: skip
    at = [float(one.get_attribute('cx')) for one in box.locator('circle').all()]
    ends = [float(x) for x in box.locator('.whisker').nth(1).evaluate(
        'e => [e.getAttribute("x1"), e.getAttribute("x2")]')]  # fmt: skip
    assert ends[0] < at[1] < ends[1]
    assert at[0] < at[2] < at[1]
    assert watched.page.evaluate('document.documentElement.scrollWidth') <= width
    assert watched.trouble == []
    watched.context.close()


def test_long_names_of_records_show_where_they_differ(opened: Watched) -> None:
    long = ['a/velocity_profile_1.csv', 'b/velocity_profile_1.csv', 'velocity_profile_2.csv']
    long += ['first_experiment/run.csv', 'second_experiment/run.csv', 'a/run.csv']
    long += ['2026_10_01_afternoon_1/speed.csv', '2026_10_01_afternoon_2/speed.csv']
    shown = opened.page.evaluate('names => names.map(fitting)', long)
    assert len(set(shown)) == len(long)
    assert max(map(len, shown)) <= 18
    assert 'a/run.csv' in shown


@pytest.fixture
def many(chromium: 'Browser', tmp_path: Path) -> Iterator[Watched]:
    """Return the report of many recordings, open; nothing may have gone wrong by the end."""
    watched = Watched(chromium, write_report(fake_variants.many_records(), tmp_path / 'many.html'))
    yield watched
    assert watched.trouble == []
    watched.context.close()


def test_many_records_are_in_a_list(many: Watched) -> None:
    assert '12 recordings: 0.csv, 1.csv, ...' in many.text('#source')
    assert 'held out: 8.csv, 9.csv, 10.csv, 11.csv (4 s)' in many.text('#source')
    buttons = many.page.locator('#stretches button')
    assert buttons.all_inner_texts() == ['all', 'training', 'held out']
    chosen = many.page.locator('#stretches select')
    assert chosen.locator('option').count() == 13
    assert chosen.locator('option:checked').inner_text() == 'one record'
    chosen.focus()
    chosen.select_option('3.csv \u00b7 training')
    start, end = many.page.evaluate('[page.view.records[3].start, page.view.records[3].end]')
    assert many.ranges()[0] == pytest.approx((start, end), abs=1e-3)
    assert many.page.locator('#stretches [aria-pressed="true"]').count() == 0
    assert many.page.evaluate('document.activeElement.tagName') == 'SELECT'
    buttons.last.click()
    assert chosen.locator('option:checked').inner_text() == 'one record'
    assert buttons.last.get_attribute('aria-pressed') == 'true'


@pytest.mark.parametrize('width', [1600, 320])
def test_long_names_in_the_list_do_not_widen_the_page(
    chromium: 'Browser', tmp_path: Path, width: int
) -> None:
    found = fake_variants.many_records()
    records = tuple(
        replace(record, provenance=Provenance(f'{"what_it_was_about_" * 4}{k}.csv'))
        for k, record in enumerate(found.records)
    )
    path = write_report(replace(found, records=records), tmp_path / 'many.html')
    watched = Watched(chromium, path, viewport={'width': width, 'height': 800})
    assert watched.page.evaluate('document.documentElement.scrollWidth') <= width
    watched.context.close()


def test_times_are_round_in_every_record(many: Watched) -> None:
    """They are those since the start of the recording, wherever that lies on the axis."""
    ticks = 'page.traces.times()'
    for text in ('all', 'held out'):
        many.page.click(f'#stretches button:has-text("{text}")')
        shown = many.page.evaluate(ticks)
        assert len(shown) > 5
        assert all(float(one.removesuffix(' s')) % 0.25 == 0.0 for one in shown), shown
    assert shown[0] == '0 s'
    assert shown.count('0 s') == 4


@pytest.fixture
def unknown(chromium: 'Browser', tmp_path: Path) -> Iterator[Watched]:
    """Return the report of something unknown, open; nothing may have gone wrong by the end."""
    path = write_report(fake_variants.unknown_shape(), tmp_path / 'unknown.html')
    watched = Watched(chromium, path)
    yield watched
    assert watched.trouble == []
    watched.context.close()


def test_something_unknown_is_shown_with_its_axis_and_shape(unknown: Watched) -> None:
    assert 'looks like a function of speed: odd' in unknown.text('#headline')
    assert 'odd, constant beyond 2 rad/s' in unknown.text('#lives')
    assert unknown.page.locator('#lives figure').count() == 1  # the quiet equation is left out
    assert unknown.page.locator('#lives path.law').count() == 1
    assert unknown.text('.axis-share.best').split() == ['speed', '93', '%']
    unknown.page.click('#blind summary')
    assert 'It turns one way only. Record both.' in unknown.text('#blind')


@pytest.mark.parametrize('verdict', Verdict)
def test_what_is_near_is_no_explanation_where_nothing_is_named(
    chromium: 'Browser', diagnosis: Diagnosis, tmp_path: Path, verdict: Verdict
) -> None:
    found = replace(diagnosis, verdict=verdict, steps=diagnosis.steps[:1])
    watched = Watched(chromium, write_report(found, tmp_path / 'report.html'))
    named = verdict in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS)
    assert ('Best explanation: Coulomb friction' in watched.text('#now')) is named
    near = 'Nearest, but not enough to be named: Coulomb friction, error'
    assert (near in watched.text('#now')) is not named
    assert ('None of these is enough to be named' in watched.text('#missing')) is not named
    ranks = watched.page.locator('.candidates .rank').all_inner_texts()
    assert ranks[:3] == (['1', '2', '\u2013'] if named else ['\u2013'] * 3)
    assert watched.page.locator('.candidates .good').count() == (2 if named else 0)
    watched.context.close()


def test_the_map_can_show_each_channel_and_each_equation(unknown: Watched) -> None:
    page = unknown.page
    picker = page.locator('#map-title select')
    picker.select_option('unexplained torque')
    assert page.locator('#map rect.layer').count() == 19  # one of 20 cells is empty
    assert page.locator('#map rect.layer.unsure').count() > 0
    assert page.locator('#map rect.layer.above').count() > 0
    assert page.locator('#map rect.layer.below').count() > 0
    page.locator('#map rect.layer.above').last.hover()
    assert '±' in unknown.text('#tip')
    picker.select_option('current error')
    assert page.locator('#map rect.layer').count() == 19
    picker.select_option('')
    assert page.locator('#map rect[data-cell]').count() > 0


def test_curves_say_what_is_noise_and_show_errors_by_channel(unknown: Watched) -> None:
    page = unknown.page
    labels = page.locator('#curves select').first.locator('option').all_inner_texts()
    assert labels[0] == 'unexplained torque by speed'
    assert 'unexplained torque by position (noise)' in labels
    assert labels.index('unexplained torque by position (noise)') > labels.index(
        'unexplained torque by current'
    )
    page.locator('#curves select').first.select_option('speed:speed')
    assert page.locator('#curves figure').first.locator('line.overall').count() == 1
    page.locator('#curves select').first.select_option('current:speed')
    assert 'even within noise' in page.locator('#curves figure').first.inner_text()
    page.click('#numbers summary')
    assert 'RMS speed error by speed, 1.10 rad/s in all' in unknown.text('#numbers')


def axe_script() -> str:
    """Return axe-core's text, or skip: it is no part of this package."""
    given = os.environ.get('MOTOR_SYSID_AXE')
    root = Path(__file__).resolve().parent.parent
    path = Path(given) if given else root / 'node_modules' / 'axe-core' / 'axe.min.js'
    if not path.is_file():
        pytest.skip('no axe-core; `npm install --no-save axe-core`, or MOTOR_SYSID_AXE=axe.min.js')
    return path.read_text(encoding='utf-8')


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_no_barrier_is_found(chromium: 'Browser', report: Path, scheme: str) -> None:
    axe = axe_script()
    for width, height in SIZES:
        watched = Watched(
            chromium, report, '#M1', color_scheme=scheme, bypass_csp=True,
            viewport={'width': width, 'height': height},
        )  # fmt: skip
        watched.page.evaluate(axe)
        watched.page.click('#numbers summary')
        found = watched.page.evaluate(
            "axe.run(document, {runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa',"
            " 'best-practice']})"
        )
        assert [violation['id'] for violation in found['violations']] == []
        watched.context.close()
