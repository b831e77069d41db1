"""The process that long work of a node runs in."""

from dataclasses import dataclass
import time

import pytest

from motor_sysid.errors import UserError
from motor_sysid.nodes import loop
from motor_sysid.nodes.worker import Done, Failed, Worker


@dataclass(frozen=True)
class Broken:
    """A job that fails, or not."""

    how: str

    def work(self) -> object:
        """Do it."""
        if self.how == 'user':
            raise UserError('give more data')
        if self.how == 'program':
            raise ValueError('no such thing')
        return 7


def done(worker: Worker, how: str) -> Done:
    assert worker.submit(Broken(how))
    end = time.monotonic() + 60
    while time.monotonic() < end:
        if found := worker.poll():
            return found
        time.sleep(0.01)
    raise AssertionError('the worker never answered')


def test_a_job_that_fails_says_why_and_the_next_one_is_worked_on():
    worker = Worker()
    try:
        assert done(worker, 'program').outcome == Failed('ValueError: no such thing')
        assert done(worker, 'user').outcome == Failed('give more data')
        assert done(worker, '').outcome == 7
    finally:
        worker.close()


def test_a_signal_ends_the_program_while_it_waits(monkeypatch):
    class Asked:
        asked = True

    monkeypatch.setattr(loop._Stop, 'latest', Asked)
    with pytest.raises(SystemExit) as ended:
        loop.wait_for(lambda: True)
    assert ended.value.code == 0
    loop.wait_for(lambda: False)
