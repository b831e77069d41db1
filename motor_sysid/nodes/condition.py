"""The condition of the motor while the identifier runs: estimates against its model file."""

from typing import TYPE_CHECKING

from motor_sysid.errors import UserError
from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.statuses import Status

if TYPE_CHECKING:
    from motor_sysid.diagnosis.condition.watch import Look

NAME = 'condition'
SECOND = 1_000_000_000


class ConditionWatch:
    """Looks at the estimates every `watch_period` of sample time.

    Parameters
    ----------
    settings:
        Of the node; without a `watch_period` nothing is looked at.

    Raises
    ------
    UserError
        If there is no `model_file` to compare with.
    """

    def __init__(self, settings: IdentifierSettings) -> None:
        self._period = round(settings.watch_period * SECOND)
        self._due = 0
        self._last: Look | None = None
        if not self._period:
            return
        if not settings.model_file:
            raise UserError('`watch_period` compares with the `model_file`; give one')
        from motor_sysid.diagnosis.condition import Watch

        self._watch = Watch(settings.model(), settings.watch_alpha, settings.watch_scatter)

    def note(self, event: Event) -> None:
        """Look, if the sample time of an event says so."""
        begins = event.stamp < self._due - self._period
        if not self._period or event.estimate is None or (event.stamp < self._due and not begins):
            return
        first = self._due == 0 or begins
        self._due = event.stamp + self._period
        if not first:  # the first samples say little
            self._last = self._watch.look(event.estimate)

    def statuses(self) -> list[Status]:
        """Return the line of /diagnostics, with one number for each parameter."""
        if not self._period:
            return []
        if self._last is None:
            return [Status(NAME, {'looks': 0}, 'not looked yet')]
        look, values = self._last, dict[str, object](looks=self._last.number)
        for k, p in enumerate(look.drift.parameters):
            values[f'{p.name}.change_percent'] = float(look.drift.percent(k))
            values[f'{p.name}.sigma_percent'] = 100 * float(look.drift.sigma[k])
        for k, one in enumerate(look.causes, 1):
            values[f'cause.{k}'] = one.words
        return [Status(NAME, values, look.words, warn=bool(look.moved))]
