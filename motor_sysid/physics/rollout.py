"""The only integrator: single runs, populations and sensitivities through one kernel."""

from collections.abc import Mapping, Sequence
from itertools import chain, zip_longest

import numpy as np
from numpy.typing import NDArray

from motor_sysid.effort import count
from motor_sysid.errors import UserError
from motor_sysid.physics.calls import begins, Calls, integers
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effect import ARGUMENTS, Effect, SPEED_SENSOR
from motor_sysid.physics.effects import effect
from motor_sysid.physics.exponential import in_vectors, step_matrices
from motor_sysid.physics.implicit import KEPT_ROWS
from motor_sysid.physics.kernel import run_block
from motor_sysid.physics.lanes import (
    compile_effect,
    FIRST_PARAMETER_ROW,
    LANES,
    ROW_OF_ARGUMENT,
    ROW_OF_FORCE,
)
from motor_sysid.physics.linear_effects import LinearEffects
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.pace import Pace
from motor_sysid.physics.readings import filter_of, NONE, placed
from motor_sysid.physics.side_by_side import run_side_by_side
from motor_sysid.physics.summed import is_stepwise, summing
from motor_sysid.physics.threads import shared
from motor_sysid.physics.vector import WIDTH
from motor_sysid.physics.workspace import (
    coarse_and_fine,
    delays,
    filled,
    halves,
    Workspace,
)

Array = NDArray[np.float64]
_NO_CORE = np.empty((0, 0, 0, 0))
_NO_SUMS = np.empty((0, 3), dtype=np.int64), -1
_ALL_THE_SAME = np.empty((3, 0), dtype=np.int64)


class Program:
    """A motor with effects, compiled: a list of law addresses and where their numbers lie.

    Parameters
    ----------
    kind:
        Motor kind.
    effects:
        Its effects.
    outputs:
        Signals to predict.
    speed_sensor:
        How the speed signal comes about.

    Attributes
    ----------
    names, delays:
        Every parameter, motor first; and the places of input delays among them.
    memory_offsets:
        Where the own states of effects lie in a workspace's buffer (first of 32 lanes each).
    has_sensors, reads_angle, tells_angle:
        Whether a law adds to what a sensor shows, whether one depends on the angle of the shaft,
        and whether an output does.
    pace:
        How many steps a sample takes.
    """

    def __init__(
        self,
        kind: Motor,
        effects: Sequence[Effect],
        outputs: Sequence[str],
        speed_sensor: SpeedSensor = SpeedSensor.IDEAL,
    ) -> None:
        self.kind, self.outputs = kind, tuple(outputs)
        self.effects = tuple(summing(kind.taking(one), speed_sensor) for one in effects)
        self.speed_sensor = speed_sensor
        self.names = tuple(p.name for p in kind.parameters) + tuple(
            f'{e.key}.{p.name}' for e in effects for p in e.card.parameters
        )
        self._lay_out()
        self._aim_outputs()

    @classmethod
    def of(cls, model: Model, outputs: Sequence[str]) -> 'Program':
        """Return the program of a model."""
        return cls(model.kind, [effect(k) for k in model.effects], outputs, model.speed_sensor)

    def _lay_out(self) -> None:
        """Give every parameter and own state its row, and sort the laws."""
        motor_names = tuple(p.name for p in self.kind.parameters)
        row = FIRST_PARAMETER_ROW + len(motor_names)
        rows = list(range(FIRST_PARAMETER_ROW, row))
        calls = Calls(self.kind)
        self._linear = LinearEffects(self.kind, [e for e in self.effects if e.card.linear])
        self._core_rows: list[int] = []
        self.memory_offsets: list[int] = []
        self._kernel_memory: list[int] = []
        self._memory_rate: list[int] = []
        self._begins: list[tuple[int, int]] = []
        for one in self.effects:
            own = row * LANES
            rows += range(row, row + len(one.card.parameters))
            row += len(one.card.parameters)
            state, count = row * LANES, len(one.card.states)
            row += 2 * count
            memory = [state + s * LANES for s in range(count)]
            self.memory_offsets += memory
            if one.card.linear:
                self._core_rows += [offset // LANES for offset in memory]
            else:
                self._kernel_memory += memory
                self._memory_rate += [offset + count * LANES for offset in memory]
            self._begins += [(memory[s], core) for s, core in begins(one, self.kind)]
            for lane in compile_effect(one, motor_names):
                calls.add(lane, own, state, in_core=one.card.linear)
        if self.kind.own:
            for lane in compile_effect(self.kind.own, motor_names):
                calls.add(lane, 0, 0)
        self._keep, self._rows, self._parameter_rows = calls.keep, row + 1, integers(rows)
        delays = [f'{one.key}.{one.card.delay}' for one in self.effects if one.card.delay]
        self.delays = [self.names.index(name) for name in delays]
        self._calls = (calls.laws, calls.stiff_count, calls.stiff_force, calls.rates)
        self._fades = np.array(calls.fades, dtype=np.bool_)
        self._slopes, self._sensors, self._sums = calls.slopes, calls.sensors, calls.sums
        self.has_sensors = len(calls.sensors) > 0
        laws, moved = calls.jumps
        rows = [ROW_OF_FORCE[f'jump_{self.kind.states[j]}'] for j in moved]
        self._jumps = laws, moved, integers(rows)
        self.pace = Pace(self.kind, self.effects, self.names, calls.slopes[1].tolist())
        self.reads_angle = any('theta' in e.needs() for e in (*self.effects, self.kind.own) if e)

    def _aim_outputs(self) -> None:
        self._keeps_count = self.kind.needs_position or 'position' not in self.outputs
        known = {output.signal: output for output in self.kind.outputs}
        zero_row = self._rows - 1
        states, differenced, bias, sensor, filters = [], [], [], [], []
        rows = dict(zip(self.names, self._parameter_rows.tolist(), strict=True))
        stepwise = [one for one in self.effects if is_stepwise(one, self.speed_sensor)]
        passed = filter_of(SPEED_SENSOR, stepwise, rows)
        self._sum_lag = passed[1]
        for signal in self.outputs:
            if signal not in known:
                raise UserError(f'a {self.kind.title} model does not predict `{signal}`')
            output = known[signal]
            late = signal == 'speed' and self.speed_sensor is SpeedSensor.DIFFERENCE
            states.append(self.kind.states.index('theta' if late else output.state))
            differenced.append(int(late))
            bias.append(
                FIRST_PARAMETER_ROW + self.names.index(output.bias) if output.bias else zero_row
            )
            sensor.append(ROW_OF_FORCE.get(f'{signal}_sensor', zero_row))
            filters.append(passed if signal == 'speed' else NONE)
        self._outputs = (
            *map(integers, (states, differenced, bias, sensor)),
            placed(filters, len(self.kind.states), self._core_rows),
        )
        self.tells_angle = any(
            self.kind.states[j] == 'theta' and not late
            for j, late in zip(states, differenced, strict=True)
        )
        self._memory = (
            integers(self._kernel_memory), integers(self._memory_rate), self._fades
        )  # fmt: skip
        self._slope_rows = integers(
            [ROW_OF_ARGUMENT.get(f'd{f.own_state}', 0) for f in self.kind.forces]
        )
        self._kind_rows = (
            integers([*(ROW_OF_ARGUMENT[s] for s in self.kind.states), *self._core_rows]),
            integers([ROW_OF_ARGUMENT[s] for s in self.kind.arguments]),
            integers([ROW_OF_FORCE[f.name] for f in self.kind.forces]),
            integers([self.kind.states.index(f.own_state) for f in self.kind.forces]),
        )

    def run(
        self,
        values: Mapping[str, Array],
        drive: Drive,
        initial: Array,
        *,
        substeps: int = 1,
        threads: int = 1,
    ) -> Array:
        """Simulate a population over one stretch; see `run_chain`.

        Returns
        -------
        (N, n_y, P) outputs.
        """
        return self.run_chain(values, [drive], [initial], substeps=substeps, threads=threads)[0]

    def run_chain(
        self,
        values: Mapping[str, Array],
        drives: Sequence[Drive],
        initials: Sequence[Array],
        *,
        restarts: Sequence[int] = (),
        pushes: Sequence[Array] = (),
        substeps: int = 1,
        threads: int = 1,
    ) -> list[Array]:
        """Simulate a population over stretches that follow each other.

        At the start of each stretch the core state is set anew; own states of effects (heat, say)
        carry on, but for restarts.  All stretches have the sample time of the first.

        Parameters
        ----------
        values:
            Every parameter name to (P,) values.
        drives:
            Inputs of each stretch.
        initials:
            For each stretch (P, n) initial states, or (n,) for all; or more of them, see `begin`.
        restarts:
            Numbers of stretches at which own states begin anew, as they do at the first.
        pushes:
            For each stretch (N, 2, m, P) forces from outside, at the start and at the end of each
            sample, in the order of the motor's forces; or nothing.
        substeps:
            Least parts of each sample (see `graded`), each cut as often as the motor's speed and
            what swings in its effects ask for.
        threads:
            Blocks of 32, or halves of the stretches, that may run at the same time.

        Returns
        -------
        For each stretch (N, n_y, P) outputs; NaN where the parameters make no motor.
        """
        size = max(np.size(value) for value in values.values())
        table = np.empty((len(self.names), size))
        for row, name in enumerate(self.names):
            table[row] = values[name]
        states = [np.broadcast_to(x, (size, x.shape[-1])) for x in initials]
        blocks = [slice(k, min(k + LANES, size)) for k in range(0, size, LANES)]
        top = max(drive.speed for drive in drives)
        substeps = max(substeps, self.pace.parts(table, drives[0].dt))
        cut = self.pace.most_steps(table, top, drives[0].dt, substeps), substeps

        def one(part: tuple[slice, slice]) -> list[Array]:
            block, some = part
            return self._run_block(
                table[:, block],
                drives[some],
                [state[block] for state in states[some]],
                [push[..., block] for push in pushes[some]],
                frozenset((0, *(n - some.start for n in restarts))),
                cut,
            )

        lengths = [len(drive.inputs) for drive in drives]
        count(size * sum(lengths) * cut[0] * cut[1])
        apart = restarts if self.memory_offsets else range(len(drives))
        few = 2 * size <= LANES or len(drives) < threads <= threads * (LANES // size)
        if few and not pushes and {0, *apart} >= set(range(len(drives))):
            found = run_side_by_side(self, table, drives, states, cut, threads)
            if found:
                return found
        stretches = halves(lengths, apart if threads > len(blocks) else ())
        tasks = [(block, some) for block in blocks for some in stretches]
        if min(threads, len(tasks)) > 1:
            parts = list(shared(threads).map(one, tasks))
        else:
            parts = [one(task) for task in tasks]
        several = len(stretches)
        runs = [chain.from_iterable(parts[k : k + several]) for k in range(0, len(parts), several)]
        if len(runs) == 1:
            return list(runs[0])
        return [np.concatenate(pieces, axis=2) for pieces in zip(*runs, strict=True)]

    def _run_block(
        self,
        table: Array,
        drives: Sequence[Drive],
        states: Sequence[Array],
        pushes: Sequence[Array],
        restarts: frozenset[int],
        cut: tuple[int, int],
    ) -> list[Array]:
        used = table.shape[1]
        workspace = self.workspace(table, drives[0].dt, *cut)
        results: list[Array] = []
        for drive, start, push in zip_longest(drives, states, pushes):
            x = np.ascontiguousarray(start[np.arange(LANES) * (np.arange(LANES) < used)].T)
            if len(results) in restarts:
                self.begin(workspace, x)
            x = x[: len(self.kind.states)]
            workspace.rest()
            outputs = np.empty((drive.inputs.shape[0], len(self.outputs), LANES))
            seen = drive.led_in() if self.delays and push is None else drive
            first, pushed = len(seen.inputs) - len(outputs), None if push is None else filled(push)
            self.advance(workspace, x, seen, cut[0], outputs, first, pushed)
            results.append(outputs[:, :, :used])
        return results

    def workspace(
        self, table: Array, dt: float, substeps: int = 1, parts: int = 1, *, delayed: bool = True,
        turning: bool = True,
    ) -> Workspace:
        """Return the matrices and work memory of up to 32 parameter vectors (one a column).

        A sample is cut in `parts` (see `graded`), each of them in `substeps` of one length.
        Without `delayed` the caller delays the input himself.  Where a stiff law may be `turning`
        within a step, that sample is taken again in finer pieces.
        """
        used = table.shape[1]
        full = np.repeat(table[:, :1], LANES, axis=1)
        full[:, :used] = table
        buffer = np.zeros((self._rows + KEPT_ROWS) * LANES)
        buffer.reshape(-1, LANES)[self._parameter_rows] = full
        late, width = np.empty(0, dtype=np.int64), np.full((1, LANES), dt)
        if delayed and self.delays:
            late, width = delays(full[self.delays], dt)
        again, even = turning and self._calls[1] > 0, bool(self.kind.wave)
        coarse, width = coarse_and_fine(width, parts, substeps, again=again, even=even)
        wide = -(-used // WIDTH) * WIDTH
        with np.errstate(all='ignore'):
            values = dict(zip(self.names, full[:, :wide], strict=True))
            linear = self._linear.extended(self.kind.matrices(values), values)
            a, b, g = (in_vectors(matrix) for matrix in linear)
            matrices = step_matrices(a, b, g, width)
        core = (a, b, g) if self._slopes[0].size else (_NO_CORE, _NO_CORE, _NO_CORE)
        return Workspace(matrices, width, wide, coarse, late, buffer, core)

    def begin(self, workspace: Workspace, x: Array) -> None:
        """Set own states to zero, or to the state of the motor in `x` (n, 32) that they follow.

        Rows after these n are what own states that follow or start begin with, in their order.
        """
        for offset in self.memory_offsets:
            workspace.buffer[offset : offset + LANES] = 0.0
        n = len(self.kind.states)
        for k, (offset, core) in enumerate(self._begins):
            if (row := n + k if len(x) > n else core) >= 0:
                workspace.buffer[offset : offset + LANES] = x[row]

    def advance(
        self,
        workspace: Workspace,
        x: Array,
        drive: Drive,
        substeps: int,
        outputs: Array,
        first: int = 0,
        push: Array | None = None,
        lanes: tuple[NDArray[np.int64], Array] | None = None,
    ) -> None:
        """Run the kernel over the drive; `x` (n, 32) and the workspace keep the final state.

        Samples before `first` serve only as older inputs of a delay.  With `lanes`, (3, 32) rows
        (first, lowest, end) and (32,) times at which they begin, each lane has its own part of
        the drive, and as many samples are run as there are outputs.
        """
        rows = workspace.buffer.reshape(-1, LANES)
        core = np.concatenate((x, rows[self._core_rows])) if self._core_rows else x
        places, begins = lanes or (_ALL_THE_SAME, np.full(LANES, drive.start))
        run_block(
            *workspace.matrices,
            workspace.width,
            workspace.wide,
            workspace.coarse,
            substeps,
            drive.dt,
            begins,
            first,
            len(outputs) if lanes else len(drive.inputs),
            drive.inputs,
            workspace.late,
            drive.told_by(self.speed_sensor).position if self.reads_angle else np.empty(0),
            0.5 * drive.count if self._keeps_count else 0.0,
            places,
            np.empty((0, 2, len(self.kind.forces), LANES)) if push is None else push,
            workspace.buffer,
            workspace.buffer.ctypes.data,
            core,
            *self._kind_rows,
            ARGUMENTS.index('t'),
            *self._calls,
            *self._memory,
            workspace.linear,
            *self._slopes,
            self._slope_rows,
            self._sensors,
            *((self._sums, self._sum_lag) if drive.ahead.size else _NO_SUMS),
            *self._jumps,
            *self._outputs,
            outputs,
        )
        if self._core_rows:
            x[:], rows[self._core_rows] = core[: len(x)], core[len(x) :]
