"""Pieces that run side by side in the lanes of one block come to what they do alone."""

import numpy as np
import pytest

from motor_sysid.physics import side_by_side
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.side_by_side import pieces_of, run_in

DT = 1e-3
MOTOR = {'R': 2.0, 'L': 1e-3, 'k_t': 0.05, 'J': 5e-5, 'b': 2e-5}
"""Time constant of 38 ms."""

EFFECTS = {
    'coulomb_friction': {'tau_c': 5e-3},
    'cogging_torque': {'a_1': 2e-3, 'n': 6.0},
    'input_delay': {'delay': 3.4e-3},
    'load_torque_step': {'tau_l': 5e-3, 't_on': 0.8, 'rise': 0.01},
}


def made(*keys: str) -> Model:
    """Return a motor with effects."""
    model = Model.base('brushed_dc', MOTOR)
    for key in keys:
        model = model.with_effect(key, EFFECTS.get(key, {}))
    return model


def drives_of(*lengths: int, position: bool = False) -> list[Drive]:
    """Return drives with steps of voltage, of different times and seeds."""
    found = []
    for seed, length in enumerate(lengths):
        rng = np.random.default_rng(seed)
        volts = np.repeat(rng.uniform(-12, 12, -(-length // 150)), 150)[:length, np.newaxis]
        angle = np.cumsum(rng.uniform(-0.2, 0.3, length)) if position else np.empty(0)
        found.append(Drive(volts, DT, 0.7 * seed, angle))
    return found


def both_ways(
    model: Model, drives: list[Drive], monkeypatch: pytest.MonkeyPatch, *, lanes: int = 3,
    outputs: tuple[str, ...] = ('speed', 'current'), restarts: tuple[int, ...] = (),
    threads: int = 1,
) -> tuple[list[np.ndarray], list[np.ndarray], int]:
    """Run a small swarm with and without sharing blocks; also how many lanes a block used."""
    program = Program.of(model, outputs)
    values = {
        name: value * (1 + 0.01 * np.arange(lanes))
        for name, value in model.parameters.values().items()
    }
    start = [np.full((lanes, len(model.kind.states)), 0.3 * k) for k in range(len(drives))]
    widest = 0
    advance = Program.advance

    def counted(self, workspace, *rest, **options):  # type: ignore[no-untyped-def]
        nonlocal widest
        if options.get('lanes'):
            places = options['lanes'][0]
            widest = max(widest, len({*zip(*places.tolist(), strict=True)}))
        return advance(self, workspace, *rest, **options)

    monkeypatch.setattr(Program, 'advance', counted)
    shared = program.run_chain(values, drives, start, restarts=restarts, threads=threads)
    monkeypatch.setattr('motor_sysid.physics.rollout.run_side_by_side', lambda *_: [])
    alone = program.run_chain(values, drives, start, restarts=restarts, threads=threads)
    return shared, alone, widest


@pytest.mark.parametrize('position', [False, True])
@pytest.mark.parametrize(
    'effects', [(), ('coulomb_friction', 'cogging_torque'), ('input_delay', 'load_torque_step')]
)
def test_short_stretches_share_a_block_to_the_last_bit(effects, position, monkeypatch):
    drives = drives_of(500, 431, 466, 390, position=position)
    shared, alone, widest = both_ways(made(*effects), drives, monkeypatch)
    assert widest == 2  # of three lanes each: more would not go into a vector
    for one, other in zip(shared, alone, strict=True):
        np.testing.assert_array_equal(one, other)


def test_stretches_with_memory_share_a_block_where_each_begins_anew(monkeypatch):
    drives, model = drives_of(500, 431, 466), made('lugre_friction')
    shared, alone, widest = both_ways(model, drives, monkeypatch, restarts=(1, 2))
    assert widest == 2
    assert all(np.array_equal(a, b) for a, b in zip(shared, alone, strict=True))
    monkeypatch.undo()
    assert both_ways(model, drives, monkeypatch, restarts=(2,))[2] == 0


@pytest.mark.parametrize('threads', [1, 2])
@pytest.mark.parametrize('sensor', SpeedSensor)
def test_a_long_stretch_is_cut_where_the_motor_forgets(sensor, threads, monkeypatch):
    """The time constants of three motors and twenty of them are 760 rows."""
    model = made('coulomb_friction', 'input_delay')
    model = Model(**{**vars(model), 'speed_sensor': sensor})
    drives = drives_of(30_000, 9_000)
    shared, alone, widest = both_ways(model, drives, monkeypatch, threads=threads)
    assert widest >= 5
    for one, other in zip(shared, alone, strict=True):
        assert one.shape == other.shape
        assert np.max(np.abs(one - other) / np.max(np.abs(other), axis=0)) < 1e-5


@pytest.mark.parametrize(('lanes', 'pieces'), [(1, 8), (3, 5), (6, 4), (8, 0)])
def test_pieces_fill_vectors_and_no_more(lanes, pieces, monkeypatch):
    """Five of three go into two vectors and four of six into three; eight fill one alone."""
    drives = drives_of(30_000)
    assert both_ways(made(), drives, monkeypatch, lanes=lanes)[2] == pieces


def test_what_remembers_is_not_cut():
    """No angle is forgotten, nor is what own states of effects hold; a wave needs its angle."""
    drives, followed = drives_of(30_000), drives_of(30_000, position=True)

    def rows(model: Model, drives: list[Drive], *outputs: str) -> float:
        program = Program.of(model, outputs or ('speed',))
        table = np.array([[v] for v in model.parameters.values().values()])
        return run_in(program, table, drives)

    assert 700 < rows(made(), drives) < 900
    assert 700 < rows(made('cogging_torque'), followed) < 900
    assert np.isinf(rows(made('cogging_torque'), drives))
    assert np.isinf(rows(made(), drives, 'position'))
    assert np.isinf(rows(made('lugre_friction'), followed))
    assert rows(Model.base('mechanical_axis', {'b': 1e-12}), drives) > 1e9
    assert np.isinf(rows(Model.base('inverse_axis'), drives, 'current'))
    assert np.isinf(rows(Model.base('pmsm'), followed))


def test_pieces_that_disagree_are_run_whole(monkeypatch):
    """A run-in of a few rows leaves much of the state; the whole stretch is run instead."""
    monkeypatch.setattr(side_by_side, 'FORGETS', 0.2)
    shared, alone, widest = both_ways(made(), drives_of(30_000), monkeypatch)
    assert widest > 2
    np.testing.assert_array_equal(shared[0], alone[0])


def test_what_runs_away_is_told_as_such(monkeypatch):
    """Lanes that make no motor are no number from the same sample on, whatever is cut."""
    program = Program.of(made(), ('speed',))
    values = {name: np.full(3, v) for name, v in made().parameters.values().items()}
    values['L'] = np.array([1e-3, np.nan, 1e-300])
    run = program.run_chain(values, drives_of(30_000), [np.zeros(3)])[0]
    assert np.all(np.isfinite(run[:, :, 0]))
    assert not np.any(np.isfinite(run[5:, :, 1:]))


def test_pieces_cover_every_row_once_and_are_no_shorter_than_worth_it():
    for run_in_rows in (0.0, 150.0, 1000.0, np.inf):
        pieces = pieces_of([10_000, 300, 4_000], 8, run_in_rows)
        for number, length in enumerate([10_000, 300, 4_000]):
            mine = [p for p in pieces if p.stretch == number]
            kept = [row for p in mine for row in range(p.kept, p.last)]
            assert kept == list(range(length))
            assert all(p.first == max(p.kept - run_in_rows, 0) for p in mine if p.kept)
        if np.isinf(run_in_rows):
            assert len(pieces) == 3
        else:
            assert len(pieces) > 3
