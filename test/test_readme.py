"""The README's Python works as it stands."""

from pathlib import Path
import re

import numpy as np
import pytest

from motor_sysid.physics.effects import add_effect_file, catalogue
from motor_sysid.physics.model import Model
from motor_sysid.physics.rollout import Stepper

README = (Path(__file__).resolve().parent.parent / 'README.md').read_text()
BLOCKS = re.findall(r'```python\n(.*?)```', README, flags=re.DOTALL)


def block_with(word: str) -> str:
    """Return the one Python block of the README that has this word."""
    (block,) = (b for b in BLOCKS if word in b)
    return block


def write_run(path: Path, model: Model, dt: float = 1e-3, samples: int = 3000) -> None:
    """Write a CSV file of that motor under a slow square wave."""
    plant, rows = Stepper(model, dt), ['time [s],voltage [V],current [A],speed [rad/s]']
    for k in range(samples):
        voltage = 6.0 if k % 1000 < 500 else -6.0
        outputs = plant.outputs
        rows.append(f'{k * dt:.4f},{voltage},{outputs["current"]:.6f},{outputs["speed"]:.6f}')
        plant.step(voltage)
    path.write_text('\n'.join(rows) + '\n')


def test_ten_lines_without_ros(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    values = {'R': 0.6, 'L': 0.5e-3, 'k_t': 0.05, 'J': 1e-4, 'b': 1e-5}
    truth = Model.base('brushed_dc', values).with_effect('coulomb_friction', {'tau_c': 0.01})
    write_run(tmp_path / 'run1.csv', truth)
    block = block_with('run1.csv')
    assert len([line for line in block.splitlines() if line]) <= 10
    exec(compile(block, 'README.md', 'exec'), {})
    errors = [float(e) for e in re.findall(r'([\d.]+) rad/s', capsys.readouterr().out)]
    assert len(errors) == 2
    assert errors[1] < 0.01 * errors[0]


def test_the_effect_shown_is_a_whole_one(tmp_path: Path) -> None:
    path = tmp_path / 'readme_drag.py'
    path.write_text(block_with('CARD'))
    effect = add_effect_file(path)
    catalogue().pop(effect.key)
    np.testing.assert_allclose(effect.laws['torque'](-3.0, 0.5), 4.5)
