"""A diagnosis that goes on by hand: add or remove an effect, and see what that does."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter

from motor_sysid.diagnosis import diagnose, Diagnosis, Settings
from motor_sysid.diagnosis.fitting import add_effect
from motor_sysid.diagnosis.one_round import one_round
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import catalogue, effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record
from motor_sysid.workbench.schema import View
from motor_sysid.workbench.view import build_view

Progress = Callable[[str], None]


class Session:
    """Models of the same data: first those of the diagnosis, then those that are asked for.

    Parameters
    ----------
    train, validation, motor, model, nominal, effects, settings, progress:
        As in `motor_sysid.diagnosis.diagnose`, which is called.

    Attributes
    ----------
    diagnosis:
        The diagnosis; its steps are all models so far.
    parents:
        For each step the index of the one that it was made from, -1 for none.
    tell:
        What is told what is going on.

    Raises
    ------
    UserError
        As `motor_sysid.diagnosis.diagnose`.
    """

    def __init__(
        self,
        train: Sequence[Record],
        validation: Sequence[Record] = (),
        *,
        motor: str | None = None,
        model: Model | None = None,
        nominal: Mapping[str, float] | None = None,
        effects: Sequence[str] | None = None,
        settings: Settings | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.tell: Progress = progress or (lambda text: None)
        self._settings = settings or Settings()
        self._effects = tuple(effects or catalogue())
        began = perf_counter()
        found = diagnose(
            train, validation, motor=motor, model=model, nominal=nominal, effects=effects,
            settings=settings, progress=self.tell,
        )  # fmt: skip
        self.diagnosis = replace(found, seconds=perf_counter() - began)
        self._found = len(self.diagnosis.steps)
        self.parents = tuple(range(-1, self._found - 1))

    def add(self, step: int, key: str) -> View:
        """Add effect `key` to model number `step`, refit, and try what is missing then.

        Returns
        -------
        What the page shows then.

        Raises
        ------
        UserError
            If there is no such model, or the effect makes no sense for it or for these data.
        """
        model = self._model(step)
        if key in model.effects:
            raise UserError(f'M{step} has {effect(key).card.title} already')
        fraction = self._settings.validation_fraction
        _, trial = add_effect(
            model, key, *self.diagnosis.searched, validation_fraction=fraction,
            progress=self.tell,
        )  # fmt: skip
        if key not in trial.rung.model.effects:
            raise UserError(f'{effect(key).card.title} cannot be fitted: {trial.note}')
        return self._go_on(step, trial.rung.model)

    def remove(self, step: int, key: str) -> View:
        """Remove effect `key` from model number `step`, refit, and try what is missing then.

        Returns
        -------
        What the page shows then.

        Raises
        ------
        UserError
            If there is no such model, or it has no such effect.
        """
        model = self._model(step)
        if key not in model.effects:
            raise UserError(f'M{step} has no effect `{key}`; it has {_listed(model.effects)}')
        self.tell(f'removing {effect(key).card.title}')
        return self._go_on(step, model.without_effect(key))

    def view(self) -> View:
        """Return what the page shows."""
        return self._view_of(self.diagnosis, self.parents)

    def _model(self, step: int) -> Model:
        steps = self.diagnosis.steps
        if not 0 <= step < len(steps):
            raise UserError(f'there is no model M{step}; the last one is M{len(steps) - 1}')
        return steps[step].model

    def _view_of(self, diagnosis: Diagnosis, parents: tuple[int, ...]) -> View:
        last = self._found - 1
        return build_view(diagnosis, effects=self._effects, parents=parents, last=last)

    def _go_on(self, parent: int, model: Model) -> View:
        """Fit a model, try every candidate on it, and keep both once they can be shown."""
        threshold = self.diagnosis.calibration
        step = one_round(
            model, *self.diagnosis.searched, effects=self._effects, settings=self._settings,
            threshold=None if threshold is None else threshold.delta_bic,
            lent=self.diagnosis.lent, progress=self.tell,
        )  # fmt: skip
        diagnosis = replace(self.diagnosis, steps=(*self.diagnosis.steps, step))
        parents = (*self.parents, parent)
        view = self._view_of(diagnosis, parents)
        self.diagnosis, self.parents = diagnosis, parents
        return view


def _listed(names: Sequence[str]) -> str:
    return ', '.join(f'`{name}`' for name in names) or 'none'
