"""What a touch of each candidate does to the outputs: the columns that a residual is regressed on.

A law without memory pushes the model by the force that it has along the model's own trajectory;
that the trajectory is moved by the push changes the force in second order only.  So all such laws
are simulated together, each in a lane of the *model's* program, whatever effects they belong to.
What a law adds to a sensor needs no simulation at all.  Effects with states of their own, delays
and laws that read rates of change are simulated with the effect in the model, all variants of an
effect at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.variants import Variant
from motor_sysid.estimation.batch import Chain, linear_of, Problem, starts_of
from motor_sysid.physics.effect import arguments, SECOND
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.summed import seen_by
from motor_sysid.threads import in_threads

Array = NDArray[np.float64]

Path = dict[str, Array]
"""Name of a state or input to its (N,) values."""

TOUCH, STRIKING_TOUCH = 1e-4, 2e-3
"""Size of a touch in units of an amplitude's whole box; and where the model strikes, so that less
of it tells of nothing but the roughness of its outputs."""


@dataclass(frozen=True)
class Touch:
    """One column: a variant and the amplitude that is moved, or none for a finite trial.

    Attributes
    ----------
    variant:
        The variant.
    name:
        Full name of the moved amplitude, or empty.
    size:
        How far it is moved; 1 for a finite trial.
    """

    variant: Variant
    name: str
    size: float

    @property
    def values(self) -> dict[str, float]:
        """Every parameter of the variant's model, touched."""
        values = self.variant.model.parameters.values()
        if self.name:
            values[self.name] += self.size
        return values


def columns(problem: Problem, tried: Sequence[Variant]) -> list[list[Array]]:
    """Return for each variant and each scored stretch the changes of the outputs (N, n_y, a).

    One column stands for each amplitude of the variant, per unit of the amplitude; or one in all
    for a finite trial, which is the whole change.  Columns that are not finite are zero.
    """
    touches = [touch for variant in tried for touch in _touches(variant)]
    alone = [k for k, touch in enumerate(touches) if _needs_its_own_model(touch.variant)]
    pushed = [k for k in range(len(touches)) if k not in set(alone)]
    keys = dict.fromkeys(touches[k].variant.effect.key for k in alone)
    groups = [[k for k in alone if touches[k].variant.effect.key == key] for key in keys]

    def changes(group: Sequence[int]) -> list[list[Array]]:
        touched = [touches[k] for k in group]
        return _pushed(problem, touched) if group is pushed else _in_model(problem, touched)

    found: dict[int, list[Array]] = {}
    work = [pushed, *groups] if pushed else groups  # the longest first
    for group, parts in zip(work, in_threads(changes, work), strict=True):
        found |= zip(group, parts, strict=True)
    result, first = [], 0
    for variant in tried:
        count = len(_touches(variant))
        parts = [found[k] for k in range(first, first + count)]
        result.append([np.stack(same, axis=2) for same in zip(*parts, strict=True)])
        first += count
    return result


def _touches(variant: Variant) -> list[Touch]:
    free = variant.model.parameters.free
    if not free:
        return [Touch(variant, '', 1.0)]
    strikes = any(effect(key).card.strikes for key in variant.model.effects)
    part = STRIKING_TOUCH if strikes else TOUCH
    return [Touch(variant, p.name, part * (p.upper - p.lower)) for p in free]


def _needs_its_own_model(variant: Variant) -> bool:
    """Whether the effect cannot be replaced by a push along the trajectory."""
    one = variant.effect
    rates = {f'd{force.own_state}' for force in variant.model.kind.forces}
    twice = any(name.startswith(SECOND) for name in one.laws)
    others = [effect(key) for key in variant.model.effects if key != one.key]
    turns = one.speed_sum and any('theta' in other.needs() for other in others)
    return bool(
        one.card.states or one.card.delay or one.needs() & rates or twice or turns
        or variant.inherits
    )  # fmt: skip


def _in_model(problem: Problem, touches: Sequence[Touch]) -> list[list[Array]]:
    """Simulate variants of one effect in the model, and the model with the effect switched off."""
    model = touches[0].variant.model
    program = Program.of(model, problem.outputs)
    lanes = [touch.values for touch in touches]
    still = [_switched_off(touch.variant) for touch in touches]
    if not touches[0].variant.inherits:
        still = still[:1]  # whatever its shape, an effect that is off does nothing
    table = {name: np.array([v[name] for v in (*lanes, *still)]) for name in program.names}
    both = run_lanes(program, model, problem, table)
    count = len(touches)
    return [
        [_finite((run[:, :, k] - run[:, :, min(count + k, run.shape[2] - 1)]) / touch.size)
         for run in both]
        for k, touch in enumerate(touches)
    ]  # fmt: skip


def _switched_off(variant: Variant) -> dict[str, float]:
    """Return the parameters of the variant's model with every amplitude at its start.

    That is zero, or what the amplitude inherits from an effect that it takes the place of; a
    finite trial starts from zero.
    """
    values = variant.model.parameters.values()
    if not variant.model.parameters.free:
        values |= {f'{variant.effect.key}.{a.name}': 0.0 for a in variant.effect.card.amplitudes}
    return values


def run_lanes(
    program: Program,
    model: Model,
    problem: Problem,
    table: Mapping[str, Array],
    pushes: Mapping[int, Array] | None = None,
) -> list[Array]:
    """Run a model's program over all chains; return the judged outputs of the scored stretches.

    `pushes` are by number of the stretch, counted over all chains.
    """
    results, first = list[Array](), 0
    linear = linear_of(model, table, problem.outputs)
    for chain in problem.chains:
        given = [] if pushes is None else [pushes[first + k] for k in range(len(chain))]
        runs = program.run_chain(
            table, [s.drive for s in chain], starts_of(model, table, chain),
            pushes=given, threads=problem.threads,
        )  # fmt: skip
        first += len(chain)
        results += [s.shown(run, linear) for run, s in zip(runs, chain, strict=True) if s.scored]
    return results


def _pushed(problem: Problem, touches: Sequence[Touch]) -> list[list[Array]]:
    """Push the model by the touched laws along its own trajectory."""
    paths = paths_of(problem)
    forces = [force.name for force in problem.model.kind.forces]
    acting = [k for k, t in enumerate(touches) if set(t.variant.effect.laws) & set(forces)]
    pushes = {
        number: np.zeros((len(acting) + 1, 2, len(forces), len(path['t']))).transpose(3, 1, 2, 0)
        for number, (path, _) in enumerate(paths)
    }
    for number, (path, ended) in enumerate(paths):
        for lane, k in enumerate(acting):
            for j, name in enumerate(forces):
                if name in touches[k].variant.effect.laws:
                    pushes[number][:, 0, j, lane + 1] = law_along(touches[k], name, path)
                    pushes[number][:, 1, j, lane + 1] = law_along(touches[k], name, ended)
    values = problem.model.parameters.values()
    table = {name: np.full(len(acting) + 1, values[name]) for name in problem.program.names}
    runs = run_lanes(problem.program, problem.model, problem, table, pushes)
    scored = scored_paths(problem, paths)
    found = []
    for k, touch in enumerate(touches):
        parts = []
        for run, (path, first) in zip(runs, scored, strict=True):
            change = np.zeros(run.shape[:2])
            if k in acting:
                change += run[:, :, acting.index(k) + 1] - run[:, :, 0]
            for y, signal in enumerate(problem.outputs):
                if f'{signal}_sensor' in touch.variant.effect.laws:
                    change[:, y] += law_along(touch, f'{signal}_sensor', path)[first:]
            parts.append(_finite(change / touch.size))
        found.append(parts)
    return found


def paths_of(problem: Problem) -> list[tuple[Path, Path]]:
    """Return for each stretch what laws see at the start and at the end of each sample."""
    model, kind = problem.model, problem.model.kind
    signals = tuple(output.signal for output in kind.outputs)
    effects = [effect(key) for key in model.effects]
    program = Program(kind, effects, signals, SpeedSensor.IDEAL)
    table = {name: np.array([v]) for name, v in model.parameters.values().items()}
    late = sum(model[f'{one.key}.{one.card.delay}'] for one in effects if one.card.delay)
    paths = []
    for chain in problem.chains:
        drives = [seen_by(model, stretch.drive) for stretch in chain]
        runs = program.run_chain(table, drives, starts_of(model, table, chain))
        for drive, run in zip(drives, runs, strict=True):
            states: Path = {
                output.state: run[:, y, 0] - (model[output.bias] if output.bias else 0.0)
                for y, output in enumerate(kind.outputs)
            }
            if drive.position.size:
                states['theta'] = drive.position
            states['t'] = drive.start + drive.dt * np.arange(len(drive.inputs), dtype=np.float64)
            inputs: Path = {
                name: np.interp(states['t'] - late, states['t'], drive.inputs[:, j])
                if late else drive.inputs[:, j]
                for j, name in enumerate(kind.arguments)
            }  # fmt: skip
            states['turn'] = drive.dt * (states if 'omega' in states else inputs)['omega']
            ended = {name: np.append(v[1:], v[-1]) for name, v in states.items()}
            paths.append(({**states, **inputs}, {**ended, **inputs}))
    return paths


def scored_paths(
    problem: Problem, paths: Sequence[tuple[Path, Path]]
) -> list[tuple[Path, int]]:
    """Return the paths of scored stretches, and the first row that counts."""
    chains: Sequence[Chain] = problem.chains
    stretches = [stretch for chain in chains for stretch in chain]
    return [
        (path, stretch.scored_from)
        for stretch, (path, _) in zip(stretches, paths, strict=True)
        if stretch.scored
    ]


def law_along(touch: Touch, name: str, path: Path) -> Array:
    """Return the (N,) value of one law of the touched variant along a path."""
    one = touch.variant.effect
    values = touch.values
    known: dict[str, Array | float] = {**values, **path}
    known |= {p.name: values[f'{one.key}.{p.name}'] for p in one.card.parameters}
    law = one.laws[name]
    found = law(*[known[argument] for argument in arguments(law)])
    return np.broadcast_to(np.asarray(found, dtype=np.float64), path['t'].shape)


def _finite(change: Array) -> Array:
    return change if np.all(np.isfinite(change)) else np.zeros_like(change)
