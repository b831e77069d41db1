"""A silence in the window of a live diagnosis: it is cut there, as a bag is."""

from collections.abc import Sequence
from dataclasses import replace

from fake_diagnosis import build_diagnosis
import numpy as np
import pytest

from motor_sysid.diagnosis.change.until_when import Held
from motor_sysid.errors import UserError
from motor_sysid.nodes.live_diagnosis import DiagnosisJob, DiagnosisOutcome
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
STEP = 0.002
BASE = Model.base('brushed_dc', {'R': 2.0, 'k_t': 0.05})


def window(*parts: tuple[float, int]) -> Record:
    """Return a window with so many samples from each moment (s) on."""
    time = np.concatenate([begin + STEP * np.arange(count) for begin, count in parts])
    return Record(time, {'voltage': np.sin(time), 'speed': time}, {'voltage': 'V', 'speed': '1'})


class Diagnosed:
    """What a diagnosis was given; it finds what was made by hand, and a change after 1.5 s."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, moment: float | None = None) -> None:
        found = build_diagnosis(4.0)
        if moment is not None:
            last = found.steps[-1]
            model = last.model.with_effect('load_torque_step', {'t_on': moment})
            found = replace(found, steps=(replace(last, model=model),))
        self.records: Sequence[Record] = ()
        self.looked_at: Record | None = None

        def diagnose(records: Sequence[Record], **given: object) -> object:
            self.records = records
            return found

        def held_until(model: Model, record: Record) -> Held | None:
            self.looked_at = record
            return None if moment is not None else Held(1.5, 2.0, 100.0)

        monkeypatch.setattr('motor_sysid.diagnosis.diagnose', diagnose)
        monkeypatch.setattr('motor_sysid.diagnosis.change.until_when.held_until', held_until)

    def outcome(self, record: Record, offset: float = 0.0) -> DiagnosisOutcome:
        return DiagnosisJob(BASE, record, START, offset).work()


def test_a_silence_ends_one_record_and_begins_another(monkeypatch: pytest.MonkeyPatch) -> None:
    diagnosed = Diagnosed(monkeypatch)
    outcome = diagnosed.outcome(window((0.0, 100), (1.0, 2000), (8.0, 1000), (14.0, 150)), 4.0)
    times = [(r.time[0], r.time[-1]) for r in diagnosed.records]
    assert times == [(1.0, pytest.approx(4.998)), (8.0, pytest.approx(9.998))]
    assert all(r.is_uniform for r in diagnosed.records), 'and nothing is made up in between'
    assert diagnosed.looked_at is diagnosed.records[-1]
    assert outcome.first_stamp == START + SECOND
    assert outcome.last_stamp == START + 9_998_000_000
    assert outcome.held_until == START + 9_500_000_000
    assert any('held until 13.5 s' in reason for reason in outcome.reasons)
    assert outcome.reasons[-1].startswith('All other times count from 12.0 s')


@pytest.mark.parametrize(('moment', 'when'), [(0.5, 8.5), (3.0, 4.0)])
def test_a_moment_counts_from_the_last_piece_that_lasts_so_long(
    monkeypatch: pytest.MonkeyPatch, moment: float, when: float
) -> None:
    diagnosed = Diagnosed(monkeypatch, moment)
    outcome = diagnosed.outcome(window((1.0, 2000), (8.0, 1000)))
    assert outcome.held_until == START + round(when * SECOND)
    assert any(f'held until {when:.1f} s' in reason for reason in outcome.reasons)


def test_without_a_gap_nothing_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    diagnosed, record = Diagnosed(monkeypatch), window((0.0, 1000), (2.01, 1000))
    outcome = diagnosed.outcome(record)
    (only,) = diagnosed.records
    assert only.digest() == record.digest()
    assert (outcome.first_stamp, outcome.last_stamp) == (START, START + 4_008_000_000)


def test_pieces_that_are_all_too_short_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UserError, match='without a gap has 150 samples; a diagnosis needs at le'):
        Diagnosed(monkeypatch).outcome(window((0.0, 150), (1.0, 150)))
