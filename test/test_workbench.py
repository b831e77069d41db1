"""The workbench: over HTTP, and with the mouse in a real browser."""

from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr
from dataclasses import replace
from http.client import HTTPConnection
from io import StringIO
import json
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys
from threading import Event, Thread
from typing import TYPE_CHECKING
from urllib.request import urlopen

from bench_motor import a_motor, measure, voltage_profile
from fake_diagnosis import build_diagnosis
import numpy as np
import pytest
from ros_harness import wait_for

from motor_sysid.cli import main
from motor_sysid.diagnosis import Settings
from motor_sysid.errors import UserError
from motor_sysid.physics.store import load_model
from motor_sysid.recording import load
from motor_sysid.recording.save import write_record
from motor_sysid.signals.record import Record
from motor_sysid.workbench.schema import View
from motor_sysid.workbench.server import Workbench
from motor_sysid.workbench.session import Session
from motor_sysid.workbench.view import build_view

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

HIDDEN = {'coulomb_friction': {'tau_c': 0.012}}
RUBBED_AND_LOADED = ['coulomb_friction', 'constant_load_torque']


@pytest.fixture(scope='module')
def bench() -> Iterator[Workbench]:
    """Return the workbench of a motor whose friction the model lacks."""
    rng = np.random.default_rng(7)
    record = measure(a_motor(HIDDEN), voltage_profile('steps', 8.0, rng), rng)
    session = Session(
        [record], effects=['coulomb_friction', 'cogging_torque', 'quadratic_drag'],
        settings=Settings(validation_fraction=0.25),
    )  # fmt: skip
    served = Workbench(session)
    thread = Thread(target=served.serve_forever)
    thread.start()
    yield served
    served.shutdown()
    thread.join()
    served.server_close()


def ask(
    bench: Workbench, verb: str, path: str, body: object = None, **headers: str
) -> tuple[int, bytes, dict[str, str]]:
    """Send one request as the page would, with other `headers` if given."""
    connection = HTTPConnection('127.0.0.1', bench.server_port, timeout=60)
    own = {'Origin': bench.address.rstrip('/')} if verb == 'POST' else {}
    text = body if isinstance(body, str) else json.dumps(body)
    connection.request(verb, path, text if verb == 'POST' else None, {**own, **headers})
    answer = connection.getresponse()
    found = answer.status, answer.read(), dict(answer.getheaders())
    connection.close()
    return found


def act(bench: Workbench, verb: str, step: int, effect: str) -> tuple[int, bytes]:
    return ask(bench, 'POST', f'/actions/{verb}', {'step': step, 'effect': effect})[:2]


def test_a_tab_that_is_closed_and_an_address_that_is_none_are_no_faults(
    bench: Workbench, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        raise ConnectionResetError(104, 'Connection reset by peer')
    except ConnectionResetError:
        bench.handle_error(None, ('127.0.0.1', 1))
    assert capsys.readouterr().err == ''
    with socket.create_connection(('127.0.0.1', bench.server_port)) as own:
        own.sendall(b'GET http://[ HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n')
        assert own.recv(100).startswith(b'HTTP/1.1 400')


def test_it_begins_with_the_diagnosis(bench: Workbench) -> None:
    status, body, headers = ask(bench, 'GET', '/view.json')
    view = json.loads(body)
    assert (status, headers['Cache-Control']) == (200, 'no-store')
    assert view['verdict']['effects'][0]['key'] == 'coulomb_friction'
    assert [s['parent'] for s in view['steps'][:2]] == [None, 0]
    assert view['last'] == 1
    keys = [effect['key'] for effect in view['effects']]
    assert sorted(keys) == ['cogging_torque', 'coulomb_friction', 'quadratic_drag']
    policy = ask(bench, 'GET', '/')[1].decode().partition('Content-Security-Policy')[2][:3000]
    assert "connect-src 'self'" in policy
    assert "default-src 'none'" in policy
    assert 'unsafe' not in policy.partition('>')[0]


def test_what_is_taken_away_and_added_again_is_as_good_as_before(bench: Workbench) -> None:
    status, body = act(bench, 'remove', 1, 'coulomb_friction')
    assert status == 200
    without = json.loads(body)['steps'][-1]
    assert without['effects'] == []
    assert without['parent'] == 1
    base, named = (json.loads(body)['steps'][k]['validation_error_percent'] for k in (0, 1))
    assert without['validation_error_percent'] == pytest.approx(base, rel=0.05)
    assert any(c['effect'] == 'coulomb_friction' and c['passes'] for c in without['candidates'])
    number = int(without['name'][1:])
    status, body = act(bench, 'add', number, 'coulomb_friction')
    view = json.loads(body)
    again = view['steps'][-1]
    assert (status, again['parent']) == (200, number)
    assert [e['key'] for e in again['added']] == ['coulomb_friction']
    assert again['validation_error_percent'] == pytest.approx(named, rel=0.02)
    assert not any(c['passes'] for c in again['candidates'])
    taken = {c['effect']: c for c in view['steps'][number]['candidates']}['coulomb_friction']
    assert (taken['added'], taken['by_hand']) == (again['name'], True)
    assert view['verdict'] == json.loads(ask(bench, 'GET', '/view.json')[1])['verdict']


def not_alike(folder: Path, loads: Sequence[float], gains: Sequence[float]) -> list[Record]:
    """Return records of a motor whose load and supply are not the same in each."""
    found = []
    for k, (load_torque, gain) in enumerate(zip(loads, gains, strict=True)):
        path = folder / f'{k}.csv'
        call = ['simulate', '--effect', *RUBBED_AND_LOADED, '--rate', '200', '--duration', '6']
        call += ['--set', f'constant_load_torque.tau_l={load_torque}', '--seed', str(k + 1)]
        assert main([*call, '-o', str(path)]) == 0
        (record,) = load(path).records
        found.append(record.with_signal('voltage', gain * record['voltage'], 'V'))
    return found


@pytest.mark.parametrize(
    ('loads', 'gains', 'shown'),
    [
        ((0.002, 0.002, 0.012, 0.002), (1.0, 1.0, 1.0, 1.0), 6),
        pytest.param((0.002, 0.002, 0.002), (1.0, 0.9, 1.0), 6, marks=pytest.mark.slow),
    ],
    ids=['the third is left out', 'the supply of the second is made up for'],
)
def test_what_is_done_by_hand_is_of_the_records_that_were_searched(
    tmp_path: Path, loads: Sequence[float], gains: Sequence[float], shown: int
) -> None:
    records = not_alike(tmp_path, loads, gains)
    session = Session(records, motor='brushed_dc', effects=RUBBED_AND_LOADED)
    steps = session.diagnosis.steps
    assert session.diagnosis.differences
    assert len(session.diagnosis.records) == shown
    key = steps[2].model.effects[1]
    session.remove(2, key)
    session.add(3, key)
    less, again = session.view()['steps'][-2:]
    for one, before in ((less, steps[1]), (again, steps[2])):
        assert [e['key'] for e in one['effects']] == list(before.model.effects)
        error = one['validation_error_percent']
        assert error == pytest.approx(before.validation_error_percent, rel=0.05)


def test_what_cannot_be_shown_leaves_the_session_as_it_was(
    bench: Workbench, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = bench.session
    before = session.diagnosis, session.parents

    def fail(*args: object, **named: object) -> View:
        raise ValueError('operands could not be broadcast together')

    step = session.diagnosis.steps[0]
    monkeypatch.setattr('motor_sysid.workbench.session.one_round', lambda *given, **more: step)
    monkeypatch.setattr('motor_sysid.workbench.session.build_view', fail)
    with pytest.raises(ValueError, match='broadcast'):
        bench.act('remove', 1, 'coulomb_friction')
    assert (session.diagnosis, session.parents) == before


def test_a_model_and_a_report_can_be_kept(bench: Workbench, tmp_path: Path) -> None:
    status, text, headers = ask(bench, 'GET', '/model.yaml?step=1')
    assert (status, 'model_M1.yaml' in headers['Content-Disposition']) == (200, True)
    (tmp_path / 'model.yaml').write_bytes(text)
    assert load_model(tmp_path / 'model.yaml').effects == ('coulomb_friction',)
    status, page, _ = ask(bench, 'GET', '/report.html')
    view = json.loads(page.decode().partition('id="view">')[2].partition('</script>')[0])
    assert (status, view['actions'], view['effects']) == (200, False, [])


@pytest.mark.parametrize(
    ('verb', 'step', 'effect', 'words'),
    [
        ('add', 1, 'coulomb_friction', 'M1 has Coulomb friction already'),
        ('add', 99, 'cogging_torque', 'there is no model M99'),
        ('add', 0, 'flux', 'flux'),
        ('add', 1, 'quadratic_drag', 'quadratic drag cannot be fitted: unphysical sign'),
        ('add', 1, 'periodic_load', 'cannot be added: no frequency stands out of the data'),
        ('add', 1, 'cogging_torque_2', 'set 2 cannot be added: cogging torque comes first'),
        ('remove', 0, 'cogging_torque', 'M0 has no effect `cogging_torque`; it has none'),
    ],
)
def test_what_cannot_be_is_said(
    bench: Workbench, verb: str, step: int, effect: str, words: str
) -> None:
    before = bench.state
    status, why = act(bench, verb, step, effect)
    assert status == 409
    assert words in why.decode()
    assert bench.state == before


def test_only_what_a_model_has_room_for_is_offered() -> None:
    """A further set of waves comes after the first, and a model has its effects' special cases."""
    keys = ['cogging_torque', 'cogging_torque_2', 'cogging_torque_3', 'coulomb_friction',
            'stribeck_friction', 'current_sensor_offset', 'periodic_load']  # fmt: skip
    whole = build_diagnosis(5.0)
    waves = whole.steps[0].model.with_effect('cogging_torque').with_effect('stribeck_friction')
    steps = (whole.steps[0], replace(whole.steps[1], model=waves))
    view = build_view(replace(whole, steps=steps), effects=keys)
    assert [step['addable'] for step in view['steps']] == [
        ['cogging_torque', 'coulomb_friction', 'stribeck_friction', 'periodic_load'],
        ['cogging_torque_2', 'periodic_load'],
    ]


def test_one_change_at_a_time(bench: Workbench) -> None:
    with bench.at_work:
        status, why = act(bench, 'add', 0, 'quadratic_drag')
    assert (status, b'another change is under way' in why) == (409, True)


@pytest.mark.parametrize(
    'body',
    ['', '[]', '{"step": "x", "effect": 1}', '{"step": 1}', '"\\', '[' * 4000,
     '{"step": 1e999, "effect": "x"}'],
)  # fmt: skip
def test_a_body_that_makes_no_sense_is_refused(bench: Workbench, body: str) -> None:
    assert ask(bench, 'POST', '/actions/add', body)[0] == 400


def test_strangers_are_refused(bench: Workbench) -> None:
    port = bench.server_port
    assert ask(bench, 'GET', '/view.json', Host=f'evil.example:{port}')[0] == 403
    assert ask(bench, 'GET', '/view.json', Host=f'localhost:{port + 1}')[0] == 200  # ssh -L
    body = {'step': 0, 'effect': 'quadratic_drag'}
    for origin in ('http://evil.example', 'null', f'http://localhost:{port}'):
        assert ask(bench, 'POST', '/actions/add', body, Origin=origin)[0] == 403
    for path in (
        '/../x', '/actions/add', '/assets', '/model.yaml', '/model.yaml?step=99',
        '/model.yaml?step=%C2%B2', f'/model.yaml?step={"9" * 5000}',
    ):  # fmt: skip
        assert ask(bench, 'GET', path)[0] == 404
    assert ask(bench, 'POST', '/actions/clear', body)[0] == 404
    assert ask(bench, 'POST', '/actions/add', 'x' * 10_000)[0] == 400
    assert ask(bench, 'POST', '/actions/add', '', **{'Content-Length': '\u00b2'})[0] == 400


def test_a_fault_of_ours_is_answered_and_told_in_the_terminal(
    bench: Workbench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(step: int, effect: str) -> None:
        raise ZeroDivisionError('a fault')

    monkeypatch.setattr(bench.session, 'add', fail)
    with redirect_stderr(StringIO()) as told:
        status, why = act(bench, 'add', 0, 'quadratic_drag')
        assert (status, b'a fault' in why) == (500, True)
        monkeypatch.undo()
        assert act(bench, 'add', 0, 'flux')[0] == 409  # it goes on
        wait_for(lambda: 'ZeroDivisionError' in told.getvalue(), 'the fault')  # after the answer
    assert 'Traceback' in told.getvalue()


def test_it_listens_to_this_machine_only_and_a_taken_port_is_said(bench: Workbench) -> None:
    assert bench.socket.getsockname()[0] == '127.0.0.1'
    with socket.socket() as other:
        other.bind(('127.0.0.1', 0))
        other.listen()
        with pytest.raises(UserError, match='choose another with --port'):
            Workbench(bench.session, other.getsockname()[1])
    with pytest.raises(UserError, match='port 70000'):
        Workbench(bench.session, 70000)


def wait(page: 'Page', condition: str, seconds: float = 60.0) -> None:
    """Wait until an expression holds on the page, whose policy lets nothing else do so."""
    for _ in range(int(10 * seconds)):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(100)
    raise AssertionError(condition)


def test_the_error_falls_at_a_click(chromium: 'Browser', bench: Workbench) -> None:
    context = chromium.new_context(viewport={'width': 1280, 'height': 800})
    page, other = context.new_page(), context.new_page()
    trouble: list[str] = []
    for each in (page, other):
        each.on('console', lambda message: trouble.append(message.text))
        each.on('pageerror', lambda error: trouble.append(str(error)))
        each.goto(bench.address)
        each.wait_for_selector('body[data-ready]')
    assert page.title().startswith('motor_sysid workbench')
    count = page.evaluate('page.view.steps.length')
    page.click('#model-table button:has-text("M1")')
    page.evaluate('page.traces.look([6.2, 6.6])')
    page.click('button[aria-label="Remove Coulomb friction"]')
    wait(page, f'page.view.steps.length === {count + 1} && page.step === {count}')
    assert page.evaluate('page.traces.range()') == pytest.approx([6.2, 6.6])
    page.click('button[aria-label="Add Coulomb friction"]')
    assert page.evaluate('document.body.classList.contains("busy")')
    wait(page, f'page.view.steps.length === {count + 2} && page.step === {count + 1}')
    errors = 'page.view.steps.slice(-2).map((s) => s.validation_error_percent)'
    before, after = page.evaluate(errors)
    assert after < 0.5 * before
    assert f'M{count} \u2192 M{count + 1}' in page.inner_text('#status')
    assert 'stop here' in page.inner_text('#now')
    wait(other, f'page.view.steps.length === {count + 2}')  # another tab follows
    assert trouble == []
    page.select_option('.other select', 'quadratic_drag')
    page.click('.other button')
    wait(page, 'document.querySelector("#status").textContent.includes("cannot be fitted")')
    assert page.evaluate('page.view.steps.length') == count + 2
    context.close()


@pytest.fixture
def opened(chromium: 'Browser', bench: Workbench) -> Iterator['Page']:
    """Return the page, which shows the last model; it must end without script errors."""
    context = chromium.new_context(viewport={'width': 1280, 'height': 800})
    page = context.new_page()
    trouble: list[str] = []
    page.on('pageerror', lambda error: trouble.append(str(error)))
    page.goto(bench.address)
    page.wait_for_selector('body[data-ready]')
    yield page
    context.close()
    assert trouble == []


@pytest.fixture
def slow(bench: Workbench, monkeypatch: pytest.MonkeyPatch) -> Iterator[Event]:
    """Return what lets a change begin that was asked for."""
    go_on = Event()
    remove = bench.session.remove

    def late(step: int, key: str) -> View:
        bench.doing = 'removing something'
        assert go_on.wait(30)
        return remove(step, key)

    monkeypatch.setattr(bench.session, 'remove', late)
    yield go_on
    go_on.set()


REMOVE = 'button[aria-label="Remove Coulomb friction"]'
COUNT = 'page.view.steps.length'


def test_what_is_being_done_stays_said(opened: 'Page', slow: Event, bench: Workbench) -> None:
    count = opened.evaluate(COUNT)
    opened.click('#model-table button:has-text("M1")')
    opened.click(REMOVE)
    opened.wait_for_timeout(300)
    assert opened.inner_text('#status').startswith('Removing')
    opened.click('#model-table button:has-text("M0")')
    assert opened.inner_text('#status').startswith('Removing')
    free = 'document.querySelectorAll("button.act:not([aria-disabled])").length'
    assert opened.evaluate(free) == 0
    opened.evaluate('document.querySelector(".other button").click()')  # one change at a time
    assert opened.inner_text('#status').startswith('Removing')
    other = opened.context.new_page()
    other.goto(bench.address)  # while the change is under way
    other.wait_for_selector('body[data-ready]')
    wait(other, 'page.doing !== ""')
    slow.set()
    for each in (opened, other):
        wait(each, f'{COUNT} === {count + 1} && page.step === {count}')
        wait(each, 'page.doing === ""')
        assert f'M{count}' in each.inner_text('#status')
        assert each.evaluate(free) > 0
        assert each.evaluate('location.hash') == f'#M{count}'


def test_what_a_user_has_chosen_stays(opened: 'Page') -> None:
    count = opened.evaluate(COUNT)
    charts = 'uPlot.sync("motor_sysid").plots.length'
    opened.click('#model-table button:has-text("M1")')
    opened.click('#panels label:has-text("voltage")')
    opened.select_option('#error-of', 'current')
    opened.click('#stretches button:has-text("all")')
    opened.select_option('#curves select >> nth=0', index=2)
    kept = '[page.traces.kept(), [...page.traces.kept().shown], page.where.kept()]'
    before, drawn = opened.evaluate(kept), opened.evaluate(charts)
    opened.focus(REMOVE)
    opened.keyboard.press('Enter')
    wait(opened, f'{COUNT} === {count + 1}')
    assert opened.evaluate(kept) == before
    assert opened.evaluate(charts) == drawn
    assert opened.evaluate('document.querySelector("#error-of").value') == 'current'
    pressed = opened.locator('#stretches button[aria-pressed="true"]')
    assert pressed.all_inner_texts() == ['all']
    assert not opened.is_checked('#panels label:has-text("voltage") input')
    # The keyboard goes on at the model that came of it.
    assert opened.evaluate('document.activeElement.textContent') == f'M{count}'
    opened.focus('#model-table button:has-text("M0")')
    opened.keyboard.press('Enter')
    assert opened.evaluate('document.activeElement.textContent') == 'M0'
    assert opened.evaluate('page.step') == 0


def test_keys_work_wherever_nothing_else_takes_them(opened: 'Page') -> None:
    opened.click('#model-table button:has-text("M0")')
    opened.keyboard.press('n')
    assert opened.evaluate('page.step') == 1
    opened.click('#zoom [data-zoom="in"]')
    before = opened.evaluate('page.traces.range()')
    opened.keyboard.press('ArrowLeft')
    assert opened.evaluate('page.traces.range()[0]') < before[0]
    opened.focus('.other select')
    opened.keyboard.press('p')
    assert opened.evaluate('page.step') == 1


def test_paper_has_no_controls(opened: 'Page') -> None:
    opened.click('#model-table button:has-text("M1")')
    controls = opened.locator('#keep, .other, button.act')
    assert controls.count() > 3
    assert controls.first.is_visible()
    opened.evaluate('dispatchEvent(new Event("beforeprint"))')
    assert not any(one.is_visible() for one in controls.all())
    opened.evaluate('dispatchEvent(new Event("afterprint"))')
    assert all(one.is_visible() for one in controls.all())


def test_a_reload_shows_the_same_model_in_the_same_light(opened: 'Page') -> None:
    opened.click('#model-table button:has-text("M1")')
    opened.click('#theme')
    assert opened.evaluate('isDark()')
    opened.reload()
    opened.wait_for_selector('body[data-ready]')
    assert opened.evaluate('[isDark(), page.step]') == [True, 1]


def test_a_workbench_that_began_anew_is_shown(opened: 'Page', bench: Workbench) -> None:
    opened.evaluate('page.ghost = "99"')  # a model that is not there after the start
    birth, bench._birth = bench._birth, 'another'
    try:
        wait(opened, 'page.view.version.startsWith("another")')
        assert opened.evaluate('page.ghost') == 'previous'
        assert opened.is_hidden('#gone')
    finally:
        bench._birth = birth


def test_units_stay_what_they_are(opened: 'Page') -> None:
    assert opened.evaluate('unitText("N m s^0.5/rad^0.5")') == 'N\u00b7m\u00b7s^0.5/rad^0.5'
    assert opened.evaluate('unitText("kg m^2")') == 'kg\u00b7m\u00b2'
    assert opened.evaluate('prefix(0.0123, "1/(V A)")') == [1, '']
    assert opened.evaluate('prefix(0.0123, "N m")') == [1000, 'm']


def test_a_workbench_that_does_not_answer_is_said(opened: 'Page') -> None:
    opened.route('**/state.json', lambda route: None)
    opened.wait_for_selector('#gone', state='visible', timeout=5000)


def test_a_workbench_that_is_gone_is_said(chromium: 'Browser', bench: Workbench) -> None:
    context = chromium.new_context()
    page = context.new_page()
    page.goto(bench.address)
    page.wait_for_selector('body[data-ready]')
    assert page.is_hidden('#gone')
    context.set_offline(True)
    page.wait_for_selector('#gone', state='visible')
    context.set_offline(False)
    page.wait_for_selector('#gone', state='hidden')
    context.close()


def test_the_example_of_its_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(7)
    drive = measure(a_motor(HIDDEN), voltage_profile('steps', 8.0, rng), rng)
    write_record(drive, tmp_path / 'drive.csv')
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).resolve().parent.parent / 'docs' / 'workbench.md').read_text()
    (code,) = re.findall(r'```python\n(.*?)```', page, re.DOTALL)
    exec(compile(code, 'workbench.md', 'exec'), {})
    base, named, without = (line.rsplit(' ', 2) for line in capsys.readouterr().out.splitlines())
    assert [line[0] for line in (base, named, without)] == ['()', "('coulomb_friction',)", '()']
    assert float(named[1]) < 0.3 * float(without[1])


@pytest.mark.skipif(
    signal.getsignal(signal.SIGINT) is signal.SIG_IGN,
    reason='what a shell starts in the background ignores SIGINT, and so does all that it starts',
)
def test_the_verb_serves_until_it_is_interrupted(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    record = measure(a_motor({}), voltage_profile('steps', 4.0, rng), rng)
    data = tmp_path / 'drive.csv'
    write_record(record, data)
    call = [sys.executable, '-m', 'motor_sysid.cli', 'workbench', str(data), '--port', '0']
    call += ['--effects', 'coulomb_friction', '--json', str(tmp_path / 'found.json'), '--open']
    browser, shown, closed = (tmp_path / name for name in ('browser', 'shown', 'closed'))
    browser.write_text(  # it runs in the foreground
        f'#!/bin/sh\necho "$1" > {shown}\n'
        f'for i in $(seq 600); do test -e {closed} && exit; sleep 0.1; done\n'
    )
    browser.chmod(0o755)
    with subprocess.Popen(
        call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, 'BROWSER': str(browser)},
    ) as run:  # fmt: skip
        assert run.stdout is not None
        told = next(line for line in run.stdout if line.startswith('workbench: '))
        address = told.split()[1]
        try:
            with urlopen(f'{address}view.json', timeout=10) as answer:
                assert json.load(answer)['verdict']['key'] == 'complete'
            wait_for(lambda: shown.exists() and shown.read_text() == f'{address}\n', 'the browser')
            run.send_signal(signal.SIGINT)
            assert run.wait(timeout=10) == 0
        finally:
            closed.touch()
            run.kill()
    assert json.loads((tmp_path / 'found.json').read_text())['verdict'] == 'complete'
