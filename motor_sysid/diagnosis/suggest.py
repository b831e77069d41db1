"""The next experiment, from a model and records: what is open, and what would decide it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from motor_sysid.diagnosis.diagnose import diagnose
from motor_sysid.diagnosis.experiment.choose import suggest_experiment, Tell
from motor_sysid.diagnosis.experiment.limits import Limits
from motor_sysid.diagnosis.experiment.result import Experiment
from motor_sysid.diagnosis.experiment.rivals import (
    fit_rivals,
    MOST,
    NONE,
    parse_rivals,
    rivals_of,
)
from motor_sysid.diagnosis.experiment.words import left_out
from motor_sysid.diagnosis.result.document import diagnosis_document
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record


def suggest(
    model: Model,
    records: Sequence[Record],
    *,
    rivals: Sequence[str] = (),
    diagnosis: Mapping[str, object] | None = None,
    parameters: Sequence[str] = (),
    limits: Limits | None = None,
    progress: Tell | None = None,
) -> Experiment:
    """Say what to record next, and what that will decide.

    Without rivals, diagnosis and parameters the records are diagnosed first; what that leaves open
    is what the experiment is for.

    Parameters
    ----------
    model:
        Model to start from; what is contested is taken out of it or added.
    records:
        What has been recorded so far.
    rivals:
        Two to four sets of effects (``coulomb_friction+constant_load_torque``, ``none``).
    diagnosis:
        Document of a diagnosis (schema ``motor_sysid/diagnosis/1``) that names the rivals.
    parameters:
        Parameters to determine better; by default those that the data tell least of.
    limits:
        What the motor must not exceed; by default what it has done in the records.
    progress:
        Is told what is going on.

    Raises
    ------
    UserError
        If a rival or parameter is unknown, or the motor has more than one input.
    """
    tell = progress or (lambda text: None)
    sets = parse_rivals(rivals) if rivals else ()
    if diagnosis is None and not rivals and not parameters:
        tell('diagnosing the records')
        found = diagnose(records, model=model, progress=progress)
        diagnosis, model = diagnosis_document(found), found.model
    if diagnosis is not None:
        sets = rivals_of(diagnosis)
    models = fit_rivals(model, sets[:MOST], records, tell) if sets else (model,)
    made = suggest_experiment(
        models, records, limits, parameters=parameters, quick=False, progress=tell
    )
    if made is None:
        raise UserError('the model has no free parameter: nothing is open')
    said = left_out(['+'.join(one) or NONE for one in sets[MOST:]])
    if diagnosis is not None and not sets:
        said = ('The diagnosis names no rivals: this is for parameters instead.',)
    return replace(made, reasons=said + made.reasons)
