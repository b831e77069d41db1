"""Metrics by hand, tests of residuals at their level, and the information in data."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from motor_sysid.cli import main
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import fit, make_chain, observed_outputs, Problem
from motor_sysid.estimation.batch.information import information
from motor_sysid.estimation.residual_tests import input_dependence, ljung_box
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.store import save_model
from motor_sysid.signals.metrics import metrics, sizes_of
from motor_sysid.signals.record import Record


class TestMetrics:
    def test_by_hand(self):
        time = np.array([1.0, 1.5, 2.0, 2.5])
        found = metrics(np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 3.0, 3.0, 2.0]), time)
        assert found.samples == 4
        assert found.sse == 5.0
        assert found.mse == 1.25
        assert found.rmse == pytest.approx(np.sqrt(1.25))
        assert found.largest == 2.0
        assert found.fit_percent == pytest.approx(0.0)
        assert found.r2 == pytest.approx(0.0)
        assert found.iae == pytest.approx(0.5 * 3)
        assert found.itae == pytest.approx(0.5 * (0.5 * 1 + 1.5 * 2))
        assert found.mape_percent == pytest.approx(100 * (0.5 + 0.5) / 4)
        assert found.smape_percent == pytest.approx(100 * (2 / 5 + 4 / 6) / 4)

    def test_itae_is_an_integral(self):
        """Not the number of samples times a sum: it does not change with the sampling."""
        for count in (2000, 8000):
            time = np.linspace(0.0, 10.0, count)
            found = metrics(np.exp(-time), np.zeros(count), time)
            assert found.itae == pytest.approx(1 - 11 * np.exp(-10.0), rel=2e-3)
            assert found.iae == pytest.approx(1.0, rel=5e-3)
        later = metrics(np.exp(-time), np.zeros(count), time, begin=-1.0)
        assert later.itae == pytest.approx(found.itae + found.iae)

    def test_zeros_and_gaps_do_no_harm(self):
        time = 0.1 * np.arange(6)
        y = np.array([0.0, 1.0, np.nan, 1.0, -1.0, 0.0])
        found = metrics(y, np.array([0.0, 1.1, 7.0, np.nan, -1.1, 0.1]), time)
        assert found.samples == 4
        assert found.ignored_percent == 50.0
        assert found.mape_percent == pytest.approx(10.0)
        flat = metrics(np.zeros(4), np.ones(4), time[:4])
        assert np.isnan([flat.fit_percent, flat.r2, flat.mape_percent, flat.smape_percent]).all()

    def test_refuses_what_makes_no_sense(self):
        with pytest.raises(UserError, match='one length'):
            metrics(np.zeros(3), np.zeros(2), np.arange(3.0))
        with pytest.raises(UserError, match='increase'):
            metrics(np.zeros(3), np.zeros(3), np.zeros(3))
        with pytest.raises(UserError, match='fewer than two'):
            metrics(np.full(3, np.nan), np.zeros(3), np.arange(3.0))


class TestResidualTests:
    """Shares of 200 runs have a standard error of 1.5 %: bounds hold with 0.9999."""

    RUNS, LEVEL = 200, 0.05

    def share(self, p_of):
        found = [p_of(np.random.default_rng(k)) < self.LEVEL for k in range(self.RUNS)]
        return np.mean(found)

    def test_ljung_box_has_its_size_and_power(self):
        assert 0.0 < self.share(lambda r: ljung_box(r.standard_normal(400)).p) < 0.115

        def coloured(r):
            return ljung_box(lfilter([1.0], [1.0, -0.2], r.standard_normal(400))).p

        assert self.share(coloured) > 0.5

    def test_the_dependence_test_has_its_size_for_coloured_noise(self):
        """The plain bands would be wrong in most of these runs."""

        def p_of(r):
            u = lfilter([1.0], [1.0, -0.95], r.standard_normal(500))
            return input_dependence(lfilter([1.0], [1.0, -0.9], r.standard_normal(500)), u, 10).p

        assert 0.0 < self.share(p_of) < 0.115

    def test_the_dependence_test_finds_a_missing_lag(self):
        def p_of(r):
            u = lfilter([1.0], [1.0, -0.95], r.standard_normal(500))
            noise = lfilter([1.0], [1.0, -0.8], r.standard_normal(500))
            return input_dependence(noise + 0.15 * np.roll(u, 3), u, 10).p

        assert np.mean([p_of(np.random.default_rng(k)) < self.LEVEL for k in range(40)]) > 0.5
        rng = np.random.default_rng(0)
        u = rng.standard_normal(4000)
        found = input_dependence(rng.standard_normal(4000) + 0.2 * np.roll(u, 3), u, 8)
        assert np.flatnonzero(np.abs(found.correlation) > 2 * found.band).tolist() == [3]

    def test_too_little_data_is_refused(self):
        with pytest.raises(UserError, match='four samples'):
            ljung_box(np.zeros(30), 20)
        with pytest.raises(UserError, match='freedom'):
            ljung_box(np.zeros(300), 5, fitted=5)
        with pytest.raises(UserError, match='two lengths'):
            input_dependence(np.zeros(100), np.zeros(90))
        assert ljung_box(np.zeros(100)).p == input_dependence(np.zeros(100), np.zeros(100)).p == 1


class TestInformation:
    def test_the_bound_is_that_of_linear_regression(self):
        rng = np.random.default_rng(0)
        x = rng.standard_normal((200, 3)) * [1.0, 1e-6, 1e5]
        found = information(x / 0.1, ['a', 'b', 'c'])
        exact = 0.1 * np.sqrt(np.diag(np.linalg.inv(x.T @ x)))
        np.testing.assert_allclose(found.bound, exact, rtol=1e-9)
        assert found.rank == 3
        assert found.condition < 3
        assert found.words() == ()

    def test_an_unseen_combination_is_named(self):
        rng = np.random.default_rng(0)
        x, y = rng.standard_normal((2, 100))
        found = information(np.column_stack([x, y, -x]), ['gain', 'lag', 'scale'])
        assert found.rank == 2
        assert found.condition == np.inf
        np.testing.assert_allclose(np.abs(found.unseen[0]), [np.sqrt(0.5), 0, np.sqrt(0.5)],
                                   atol=1e-9)  # fmt: skip
        assert np.isfinite(found.bound).tolist() == [False, True, False]
        (said,) = found.words()
        assert said == 'these data see gain, scale only in combination; fix one of them'

    def test_a_fit_reaches_its_bound(self):
        """Errors over bounds of 30 noise seeds: their mean square is 1 +- 0.1."""
        true = {'R': 1.2, 'L': 1.5e-3, 'k_t': 0.055, 'J': 8e-5, 'b': 3e-5}
        model = Model.base('brushed_dc', true)
        time = 1e-3 * np.arange(1000)
        volts = np.repeat(np.random.default_rng(1).uniform(-12, 12, 10), 100)
        clean = simulate(model, Record(time, {'voltage': volts}, {'voltage': 'V'}),
                         follow_position=False, substeps=4).outputs  # fmt: skip
        ratios = []
        for seed in range(30):
            noise = np.random.default_rng(seed).standard_normal((2, time.size))
            record = Record(time, {
                'voltage': volts, 'current': clean['current'] + 0.02 * noise[0],
                'speed': clean['speed'] + 0.5 * noise[1],
            }, {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'})  # fmt: skip
            outputs = observed_outputs(model.kind, [record])
            result = fit(Problem(model, [make_chain(record, model.kind, outputs)], outputs))
            told = result.information
            assert told.rank == len(told.names)
            wanted = [told.names.index(n) for n in true]
            errors = [result.model[n] - v for n, v in true.items()]
            ratios.append(np.array(errors) / told.bound[wanted])
        assert 0.6 < np.mean(np.square(ratios)) < 1.5


def test_the_command_line_tells_them(tmp_path, capsys):
    model = Model.base('brushed_dc', {'R': 1.2, 'L': 1.5e-3, 'k_t': 0.055, 'J': 8e-5, 'b': 3e-5})
    rng = np.random.default_rng(0)
    time = 2e-3 * np.arange(1500)
    volts = np.repeat(rng.uniform(-12, 12, 30), 50)
    clean = simulate(model, Record(time, {'voltage': volts}, {'voltage': 'V'})).outputs
    current = clean['current'] + 0.05 * rng.standard_normal(time.size)
    speed = clean['speed'] + 0.5 * rng.standard_normal(time.size)
    np.savetxt(tmp_path / 'run.csv', np.column_stack([time, volts, current, speed]), delimiter=',',
               header='time [s],voltage [V],current [A],speed [rad/s]', comments='')  # fmt: skip
    save_model(model, tmp_path / 'model.yaml')
    data, said = str(tmp_path / 'run.csv'), tmp_path / 'said.json'
    assert main(['compare', str(tmp_path / 'model.yaml'), data, '--json', str(said)]) == 0
    found = json.loads(said.read_text())['metrics']
    assert 0.045 < found['current']['rmse'] < 0.1  # it starts from the first, noisy, samples
    assert found['speed']['fit_percent'] > 99
    assert found['speed']['samples'] > 1400
    assert main(['fit', data, '--model', str(tmp_path / 'model.yaml'), '--json', str(said)]) == 0
    told = json.loads(said.read_text())['identifiability']
    assert told['rank'] == told['parameters'] >= 5
    assert 0 < told['cramer_rao']['R'] < 0.05
    assert 'fit 99.' in capsys.readouterr().out


def test_the_d_current_counts_by_the_size_of_the_whole_current():
    """A drive holds it at zero: by its own RMS its noise is all of it."""
    rows = [np.tile([10.0, 0.03, 4.0], (50, 1)), np.tile([-10.0, 0.03, -4.0], (70, 1))]
    assert sizes_of(['speed', 'current_d', 'current_q'], rows) == pytest.approx(
        [10.0, np.hypot(0.03, 4.0), np.hypot(0.03, 4.0)]
    )
    assert sizes_of(['speed', 'current_d', 'current'], rows) == pytest.approx([10.0, 0.03, 4.0])
