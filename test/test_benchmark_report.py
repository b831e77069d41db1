"""What the benchmark makes of its results: outcomes, rates against goals, tables, page."""

from dataclasses import replace
import json
from pathlib import Path
import re
import subprocess
import sys

from benchmark_tools import mixture, result
import pytest

from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.judge import outcome
from motor_sysid.benchmark.outcome import Outcome
from motor_sysid.benchmark.page import page
from motor_sysid.benchmark.scenarios import Scenario
from motor_sysid.benchmark.statistics import Share
from motor_sysid.benchmark.store import ResultsFile
from motor_sysid.benchmark.tables import as_dict, effect_table, tables, time_table
from motor_sysid.benchmark.targets import (
    both_visible,
    Goal,
    named_as_well,
    named_first,
    rates,
    runs_as_well,
    visible,
)
from motor_sysid.diagnosis.result.result import Verdict

MISSING, COMPLETE, AMBIGUOUS, UNKNOWN = (
    Verdict.EFFECT_MISSING, Verdict.COMPLETE, Verdict.AMBIGUOUS, Verdict.UNKNOWN_EFFECT,
)  # fmt: skip

SAID = (
    ((), False, COMPLETE, (), set(), Outcome.RIGHT),
    ((), False, MISSING, ('quadratic_drag',), set(), Outcome.FALSE_ALARM),
    ((), False, UNKNOWN, (), set(), Outcome.FALSE_ALARM),
    (('coulomb_friction',), False, MISSING, ('coulomb_friction',), set(), Outcome.RIGHT),
    (('coulomb_friction',), False, COMPLETE, (), set(), Outcome.MISSED),
    (('coulomb_friction',), False, UNKNOWN, (), set(), Outcome.UNKNOWN),
    (('coulomb_friction',), True, UNKNOWN, (), set(), Outcome.RIGHT),
    (('coulomb_friction',), True, MISSING, ('quadratic_drag',), set(), Outcome.WRONG),
    (('coulomb_friction',), False, Verdict.INSUFFICIENT_DATA, (), set(), Outcome.INSUFFICIENT),
    (('coulomb_friction',), False, MISSING, ('quadratic_drag',), set(), Outcome.WRONG),
    (('coulomb_friction',), False, MISSING, ('coulomb_friction', 'quadratic_drag'), set(),
     Outcome.EXTRA),
    (('coulomb_friction',), False, AMBIGUOUS, ('quadratic_drag',), {'coulomb_friction'},
     Outcome.AMBIGUOUS),
    (('coulomb_friction',), False, AMBIGUOUS, ('quadratic_drag',), {'gravity_load'},
     Outcome.WRONG),
    (('asymmetric_coulomb_friction',), False, MISSING, ('coulomb_friction',), set(),
     Outcome.PART),
    (('asymmetric_coulomb_friction',), False, MISSING,
     ('constant_load_torque', 'coulomb_friction'), set(), Outcome.RIGHT),
    (('coulomb_friction', 'quadratic_drag'), False, MISSING, ('quadratic_drag',), set(),
     Outcome.PART),
    (('current_sensor_scale',), False, COMPLETE, (), set(), Outcome.RIGHT),
    (('current_sensor_scale',), False, MISSING, ('quadratic_drag',), set(), Outcome.WRONG),
)  # fmt: skip


@pytest.mark.parametrize(('hidden', 'withheld', 'verdict', 'named', 'rivals', 'expected'), SAID)
def test_outcomes(hidden, withheld, verdict, named, rivals, expected):
    case = _case(hidden, withheld)
    assert outcome(case.scenario, verdict, named, rivals) is expected


_DRAWN = {}


def _case(hidden, withheld):
    """Return a case; what was drawn for a complete model serves for all of them."""
    if not _DRAWN:
        _DRAWN['plain'] = draw(Scenario(()), 0, 0)
    size = 0.03 if hidden else 0.0
    return replace(_DRAWN['plain'], scenario=Scenario(hidden, size, withheld))


def test_shares_have_wilson_limits():
    assert Share(0, 40).limits == pytest.approx((0.0, 0.0876), abs=1e-4)
    assert Share(20, 40).value == 0.5
    assert str(Share(0, 0)) == '-'


@pytest.mark.parametrize(
    ('goal', 'count', 'total', 'expected'),
    [
        (Goal(highest=0.01), 0, 0, 'not enough runs'),
        (Goal(highest=0.01), 0, 50, 'not enough runs'),
        (Goal(highest=0.01), 0, 500, 'pass'),
        (Goal(highest=0.01), 4, 500, 'pass, not certain'),
        (Goal(highest=0.01), 7, 500, 'fail, not certain'),
        (Goal(highest=0.01), 20, 500, 'fail'),
        (Goal(lowest=0.97), 20, 20, 'not enough runs'),
        (Goal(lowest=0.97), 300, 300, 'pass'),
        (Goal(lowest=0.97), 292, 300, 'pass, not certain'),
        (Goal(lowest=0.97), 288, 300, 'fail, not certain'),
        (Goal(lowest=0.97), 250, 300, 'fail'),
        (Goal(0.93, 0.97), 950, 1000, 'pass'),
        (Goal(0.93, 0.97), 95, 100, 'pass, not certain'),
        (Goal(0.93, 0.97), 1000, 1000, 'fail'),
    ],
)
def test_a_goal_is_met_for_certain_only_when_the_limits_say_so(goal, count, total, expected):
    assert goal.verdict(Share(count, total)) == expected


def test_rates_count_what_they_say():
    shares = {rate.title: rate.share for rate in rates(mixture())}
    found = {name: (s.count, s.total) for name, s in shares.items()}
    assert found['complete model: something is said to be missing'] == (1, 41)
    assert found['one effect, 3 %: named first'] == (61, 63)
    assert found['effects in the catalogue: a wrong name'] == (1, 65)
    assert found['two effects: exact set'] == (1, 2)
    assert found['effect not in the catalogue: said to be unknown'] == (1, 1)
    assert found['any case: it raised, crashed or ran out of time'] == (1, 107)


def test_the_first_name_counts_in_any_equivalent_form():
    both = ('constant_load_torque', 'coulomb_friction')
    assert named_first(result(('asymmetric_coulomb_friction',), named=both))
    assert not named_first(result(('coulomb_friction',), named=('quadratic_drag',)))
    assert not named_first(result(('coulomb_friction',), named=()))


def test_a_special_case_that_runs_as_well_is_counted_apart():
    stribeck = {'named': ('stribeck_friction',), 'reference': 2.0}
    assert named_as_well(result(('lugre_friction',), after=2.03, **stribeck))
    assert not named_as_well(result(('lugre_friction',), after=2.05, **stribeck))
    assert not named_first(result(('lugre_friction',), after=2.03, **stribeck))
    assert not named_as_well(result(('quadratic_drag',), after=2.0, **stribeck))
    assert named_as_well(result(('stribeck_friction',), after=9.0, **stribeck))


def test_a_part_of_two_effects_that_runs_as_well_is_counted_apart():
    two = ('lugre_friction', 'speed_sensor_offset')
    part = {'outcome': Outcome.PART, 'reference': 2.0}
    assert runs_as_well(result(two, after=2.03, **part))
    assert not runs_as_well(result(two, after=2.05, **part))
    assert runs_as_well(result(two, outcome=Outcome.RIGHT, after=2.05, reference=2.0))
    assert not runs_as_well(result(two, outcome=Outcome.EXTRA, after=2.0, reference=2.0))


def test_an_effect_is_visible_if_the_true_structure_runs_better():
    assert visible(result(('coulomb_friction',), before=2.05, reference=2.0))
    assert not visible(result(('coulomb_friction',), before=2.03, reference=2.0))
    two = ('coulomb_friction', 'cogging_torque')
    assert both_visible(result(two, before=9.0, lacking=2.05, reference=2.0))
    assert not both_visible(result(two, before=9.0, lacking=2.03, reference=2.0))


def texts(table):
    return [tuple(cell.text for cell in row) for row in table.rows]


def test_each_single_effect_has_a_row():
    dry = [result(('coulomb_friction',), number=k, before=6.0) for k in range(3)]
    hidden = result(('coulomb_friction',), Outcome.MISSED, (), number=3, before=2.01, size=0.01)
    special = result(('lugre_friction',), Outcome.PART, ('stribeck_friction',), after=2.01)
    wrong = result(('iron_loss',), Outcome.WRONG, ('gravity_load',), after=3.0)
    pair = result(('coulomb_friction', 'iron_loss'))
    unseen = result(('current_sensor_scale',), named=())
    assert texts(effect_table([*dry, hidden, special, wrong, pair, unseen, result()])) == [
        ('coulomb_friction', '4', '3', '3', '', '', '6 % → 2 % → 2 %'),
        ('iron_loss', '1', '1', '', '', '1', '5 % → 3 % → 2 %'),
        ('lugre_friction', '1', '1', '', '1', '', '5 % → 2.01 % → 2 %'),
    ]


def test_times_are_told_by_kind_of_case():
    some = [result(number=k, seconds=float(k)) for k in range(11)]
    assert texts(time_table([*some, result(('iron_loss',), seconds=7.0)])) == [
        ('complete', '11', '5.0 s', '9.0 s', '10.0 s'), ('single', '1', '7.0 s', '7.0 s', '7.0 s')
    ]  # fmt: skip


def test_json_holds_rates_confusion_and_cases():
    results = mixture()
    document = json.loads(json.dumps(as_dict(results)))
    assert len(document['cases']) == len(results)
    assert sum(row['count'] for row in document['confusion']) == len(results)
    assert any(rate['verdict'] for rate in document['rates'])


def test_the_page_is_self_contained_and_escapes_what_it_shows():
    results = mixture()
    html = page(results, {'seed': '<3>'})
    assert not re.search(r'(src|href)=|https?://|@import|url\(', html)
    assert '<no> way' not in html
    assert '&lt;no&gt; way' in html
    assert '<3>' not in html
    for table in tables(results):
        assert table.title in html


def test_results_without_anything_still_make_a_page():
    assert '</html>' in page([], {})


def command(*arguments: object) -> 'subprocess.CompletedProcess[str]':
    line = [sys.executable, '-m', 'motor_sysid.cli', 'benchmark', *map(str, arguments)]
    return subprocess.run(line, capture_output=True, text=True, check=False)


def test_report_shows_what_a_file_holds(tmp_path: Path):
    path, html, document = (tmp_path / name for name in ('r.jsonl', 'r.html', 'r.json'))
    with ResultsFile(path, 0) as file:
        for each in mixture():
            file.add(each)
    done = command('report', path, '--page', html, '--json', document)
    assert done.returncode == 0, done.stderr
    assert 'Rates' in done.stdout
    assert 'not enough runs' in done.stdout
    assert '</html>' in html.read_text()
    assert len(json.loads(document.read_text())['cases']) == len(mixture())


@pytest.mark.parametrize(
    ('arguments', 'expected'),
    [
        (('report',), 'at least one results file'),
        (('report', 'absent.jsonl'), 'cannot read absent.jsonl'),
        (('diagnosis', 'some.jsonl'), '--results'),
        (('diagnosis', '--runs', 0), 'at least 1'),
        (('diagnosis', '--limit', 0), '--limit is 0'),
        (('diagnosis', '--seed', -1), '--seed is -1'),
        (('diagnosis', '--case', 'magic/1'), 'no case `magic/1`'),
    ],
)
def test_wrong_arguments_are_named_in_one_line(arguments, expected):
    done = command(*arguments)
    assert done.returncode == 2
    assert expected in done.stderr
    assert done.stderr.count('\n') == 1
