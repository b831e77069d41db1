"""What a computation may take is counted in steps, and a search that took it all says so."""

from bench_motor import records
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Settings
from motor_sysid.diagnosis.diagnose import CUT
from motor_sysid.diagnosis.result.result import Verdict
from motor_sysid.diagnosis.settings import EFFORT, EFFORT_A_SAMPLE
from motor_sysid.effort import count, counted_by, current, Effort, is_spent
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.threads import in_threads

FRICTION = {'coulomb_friction': {'tau_c': 4e-3}}


def test_nothing_is_counted_where_nobody_asked():
    count(10)
    assert current() is None
    assert not is_spent()


def test_the_limit_is_noted_once_it_was_asked_for():
    effort = Effort(10)
    with counted_by(effort):
        count(10)
        assert not is_spent()
        count(1)
        assert not effort.cut
        assert is_spent()
        with counted_by(None):
            count(100)
            assert not is_spent()
    assert (effort.steps, effort.cut) == (11, True)
    assert current() is None


def test_what_is_counted_inside_counts_outside_as_well():
    outer = Effort()
    with counted_by(outer):
        with counted_by(inner := Effort()):
            in_threads(count, (1, 2))
        count(4)
    assert (inner.steps, outer.steps) == (3, 7)


def test_threads_count_for_who_started_them():
    effort = Effort()
    with counted_by(effort):
        in_threads(count, range(1, 101))
    assert effort.steps == 5050


@pytest.mark.parametrize('substeps', [1, 4])
def test_a_run_takes_as_many_steps_as_its_samples_are_cut_in(substeps):
    model = Model.base('brushed_dc', {'R': 1.2, 'L': 1.5e-3, 'k_t': 0.05, 'J': 8e-5, 'b': 3e-5})
    effort, record = Effort(), records({}, seconds=1.0)[0]
    with counted_by(effort):
        simulate(model, record, substeps=substeps)
    assert effort.steps == substeps * len(record)


def test_more_samples_may_take_more():
    assert Settings().effort_for(0).limit == EFFORT
    assert Settings(effort=2.0).effort_for(1000).limit == 2 * (EFFORT + 1000 * EFFORT_A_SAMPLE)


@pytest.mark.parametrize('effort', [1e-9, 1.0])
def test_a_search_without_time_names_what_is_plain_and_says_that_it_was_cut(effort):
    """The first effect is added all the same: else a friction that helps were called complete."""
    train = records(FRICTION, seconds=2.0)
    found = diagnose(train, motor='brushed_dc', settings=Settings(effort=effort))
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.effects == ('coulomb_friction',)
    assert (CUT in found.warnings) is (effort < 1.0)


@pytest.mark.slow
def test_the_same_effort_gives_the_same_answer():
    train = records({**FRICTION, 'input_delay': {'delay': 2.5e-3}}, seconds=2.0)
    one, other = (
        diagnose(train, motor='brushed_dc', settings=Settings(effort=0.005)) for _ in range(2)
    )
    assert one.effects == other.effects
    assert np.array_equal(
        [p.value for p in one.model.parameters], [p.value for p in other.model.parameters]
    )
