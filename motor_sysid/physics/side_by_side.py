"""Pieces of data that run at the same time, in the lanes of one block or in two threads.

A step costs the same for one lane as for the eight of a vector.  Where parameter vectors leave
lanes idle, stretches that know nothing of each other share a block; else each thread has a block.
A long stretch of a motor without memory is cut: after some time constants nothing is left of what
its state was, so that a piece may begin that much earlier, at rest.  Where two pieces meet they
must agree; otherwise nothing is cut.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.drive import Drive
from motor_sysid.physics.native import LANES
from motor_sysid.physics.threads import shared
from motor_sysid.physics.vector import WIDTH
from motor_sysid.physics.workspace import Workspace

if TYPE_CHECKING:
    from motor_sysid.physics.rollout import Program

Array = NDArray[np.float64]

FORGETS = 20.0
"""Time constants after which a state is forgotten, but for 2e-9 of it."""

RUN_INS, SHORTEST = 3, 200
"""A piece of a stretch is at least so many times as long as its run-in, and has so many rows."""

SEAM, AGREES = 3, 1e-6
"""Rows in which pieces that meet are compared, and how well they agree, in units of the largest
output; the implicit part of a step is not solved better than that."""

SPARSE = 16
"""Every so manieth row tells how large an output is."""

WORTH_IT = 1.2
"""How many times fewer steps must be run: a lane with data of its own costs more."""


@dataclass(frozen=True)
class Piece:
    """What one lane runs over: rows `first` to `last` of a stretch; those from `kept` on count."""

    stretch: int
    first: int
    kept: int
    last: int

    def __len__(self) -> int:
        """Return how many rows it runs over."""
        return self.last - self.first


def run_side_by_side(
    program: 'Program',
    table: Array,
    drives: Sequence[Drive],
    states: Sequence[Array],
    cut: tuple[int, int],
    threads: int,
) -> list[Array]:
    """Simulate stretches that know nothing of each other in the lanes of few blocks.

    Parameters
    ----------
    program:
        What is simulated.
    table:
        (K, P) parameter vectors, in the order of the program's names.
    drives, states:
        Inputs and (P, n) initial state of each stretch.
    cut:
        Steps of each part of a sample, and its parts.
    threads:
        Blocks that may run at the same time.

    Returns
    -------
    For each stretch (N, n_y, P) outputs; nothing, if that is no gain or pieces disagree.
    """
    lengths, size = [len(drive.inputs) for drive in drives], table.shape[1]
    if not _can_join(drives):
        return []
    known = run_in(program, table, drives)
    packs = min(
        (_packed(lengths, lanes, threads, known) for lanes in _full(size)),
        key=lambda packs: _steps(packs, size, threads),
    )
    if WORTH_IT * _steps(packs, size, threads) > vectors(size) * sum(lengths):
        return []
    seen = [drive.led_in() for drive in drives] if program.delays else drives
    whole = _joined(seen)
    rows = np.cumsum([0, *(len(drive.inputs) for drive in seen)])
    fresh = {
        n: program.workspace(np.tile(table, n), whole.dt, *cut) for n in {len(p) for p in packs}
    }

    def one(pack: Sequence[Piece]) -> Array:
        workspace = fresh[len(pack)].again()
        return _run_pack(program, size, workspace, (whole, rows), drives, states, pack, cut[0])

    runs = list(shared(threads).map(one, packs))
    found = {
        (piece.stretch, piece.kept): (piece, run[: len(piece), :, k * size : (k + 1) * size])
        for pack, run in zip(packs, runs, strict=True)
        for k, piece in enumerate(pack)
    }
    return _sewn([found[key] for key in sorted(found)])


def pieces_of(lengths: Sequence[int], lanes: int, run_in: float) -> list[Piece]:
    """Cut stretches of so many rows, so that about `lanes` pieces of like length run at once.

    A piece that begins within a stretch has `run_in` rows before it counts; where that is
    infinite, no stretch is cut.
    """
    pieces: list[Piece] = []
    wanted = max(sum(lengths) / lanes, RUN_INS * run_in, SHORTEST)
    for number, length in enumerate(lengths):
        count = max(round(length / wanted), 1)
        if count == 1:
            pieces.append(Piece(number, 0, 0, length))
            continue
        edges = np.linspace(0, length, count + 1).astype(int).tolist()
        pieces += [
            Piece(number, max(a - int(run_in), 0) if a else 0, a, b) for a, b in pairwise(edges)
        ]
    return pieces


def run_in(program: 'Program', table: Array, drives: Sequence[Drive]) -> float:
    """Return after how many rows parameter vectors (K, P) have forgotten their state.

    Nothing forgets its angle: that must be measured, or matter to nobody.  Infinite, where own
    states of effects or laws that turn with the motor remember.
    """
    kind = program.kind
    told = program.tells_angle or (
        program.reads_angle and not all(drive.position.size for drive in drives)
    )
    if told or program.memory_offsets or kind.wave or 'theta' not in kind.states:
        return np.inf
    with np.errstate(all='ignore'):
        core = kind.matrices(dict(zip(program.names, table, strict=True)))[0]
    if not np.all(np.isfinite(core)):
        return np.inf
    others = [j for j, name in enumerate(kind.states) if name != 'theta']
    rates = -np.linalg.eigvals(core[:, others][:, :, others]).real
    slowest = float(np.min(rates))
    return SEAM + FORGETS / (slowest * drives[0].dt) if slowest > 0.0 else np.inf


def _can_join(drives: Sequence[Drive]) -> bool:
    """Whether all drives have a position for each row, or all have none."""
    sizes = [drive.position.size for drive in drives]
    summed = {bool(drive.ahead.size) for drive in drives}
    even = not any(sizes) or sizes == [len(drive.inputs) for drive in drives]
    return even and len(summed) == 1


def _joined(drives: Sequence[Drive]) -> Drive:
    """Return the drives one after the other as one."""
    inputs = np.concatenate([drive.inputs for drive in drives])
    position, ahead = (
        np.concatenate([getattr(d, name) for d in drives]) for name in ('position', 'ahead')
    )
    count = max(drive.count for drive in drives)
    return Drive(inputs, drives[0].dt, 0.0, position, count=count, ahead=ahead)


def vectors(lanes: int) -> int:
    """Return in how many vectors so many lanes are."""
    return -(-lanes // WIDTH)


def _full(size: int) -> set[int]:
    """Return how many pieces of `size` lanes fill vectors best; one, if no two go into a block."""
    return {1, *(some * WIDTH // size for some in range(1, LANES // WIDTH + 1))} - {0}


def _packed(
    lengths: Sequence[int], lanes: int, threads: int, run_in: float
) -> list[list[Piece]]:
    """Return pieces in packs of at most `lanes`, the longest together and first."""
    pieces = pieces_of(lengths, lanes * threads, run_in)
    count = max(min(lanes, -(-len(pieces) // threads)), 1)
    longest_first = sorted(pieces, key=len, reverse=True)
    return [longest_first[k : k + count] for k in range(0, len(pieces), count)]


def _steps(packs: Sequence[Sequence[Piece]], size: int, threads: int) -> float:
    """Return how many steps of vectors each thread has to run."""
    return sum(len(pack[0]) * vectors(len(pack) * size) for pack in packs) / threads


def _run_pack(
    program: 'Program',
    size: int,
    workspace: Workspace,
    joined: tuple[Drive, NDArray[np.int64]],
    drives: Sequence[Drive],
    states: Sequence[Array],
    pack: Sequence[Piece],
    substeps: int,
) -> Array:
    """Run pieces side by side, `size` lanes each; return (N, n_y, 32) outputs of the longest.

    `joined` are all drives as one, older inputs with them, and the row at which each begins.
    """
    whole, rows = joined
    n, begins = len(program.kind.states), np.zeros(LANES)
    x = np.zeros((states[0].shape[1], LANES))
    places = np.zeros((3, LANES), dtype=np.int64)
    for slot, piece in enumerate(pack):
        lanes, number = slice(slot * size, (slot + 1) * size), piece.stretch
        if piece.first == 0:
            x[:, lanes] = states[number].T
        places[0, lanes] = rows[number + 1] - len(drives[number].inputs) + piece.first
        places[1, lanes], places[2, lanes] = rows[number], rows[number + 1]
        begins[lanes] = drives[number].start + piece.first * whole.dt
    for values in (x, places, begins[np.newaxis]):
        values[:, len(pack) * size :] = values[:, :1]
    program.begin(workspace, x)
    workspace.rest()
    outputs = np.empty((len(pack[0]), len(program.outputs), LANES))
    program.advance(workspace, x[:n], whole, substeps, outputs, lanes=(places, begins))
    return outputs


def _sewn(runs: Sequence[tuple[Piece, Array]]) -> list[Array]:
    """Return the outputs (N, n_y, P) of each stretch from those of its pieces, in their order."""
    whole: list[list[Array]] = []
    for piece, run in runs:
        inner = piece.kept - piece.first
        kept = run[inner:]
        if piece.kept == 0:
            whole.append([kept])
            continue
        size = np.max(np.abs(kept[::SPARSE]), axis=0)
        if not _agree(whole[-1][-1][-SEAM:], run[inner - SEAM : inner], size):
            return []
        whole[-1].append(kept)
    return [np.concatenate(parts) for parts in whole]


def _agree(before: Array, after: Array, size: Array) -> bool:
    """Whether two pieces (SEAM, n_y, P) are the same where they meet; `size` is (n_y, P)."""
    neither = np.isnan(before) & np.isnan(after)
    return bool(np.all((np.abs(before - after) <= AGREES * size) | neither))
