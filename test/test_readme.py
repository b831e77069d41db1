"""The README's Python works as it stands."""

from pathlib import Path
import re

from bench_motor import records
import numpy as np
import pytest

from motor_sysid.physics.effects import add_effect_file, catalogue
from motor_sysid.physics.store import load_model

README = (Path(__file__).resolve().parent.parent / 'README.md').read_text()
BLOCKS = re.findall(r'```python\n(.*?)```', README, flags=re.DOTALL)


def block_with(word: str) -> str:
    """Return the one Python block of the README that has this word."""
    (block,) = (b for b in BLOCKS if word in b)
    return block


def test_ten_lines_without_ros(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    record = records({'coulomb_friction': {'tau_c': 6e-3}}, ['steps'], seconds=5.0)[0]
    names = {n: f'{n} [{record.units[n]}]' for n in record}
    table = np.column_stack([record.time, *record.signals.values()])
    header = ','.join(['time [s]', *names.values()])
    np.savetxt(tmp_path / 'run1.csv', table, delimiter=',', header=header, comments='')
    block = block_with('run1.csv')
    assert len([line for line in block.splitlines() if line]) <= 10
    exec(compile(block, 'README.md', 'exec'), {})
    said = capsys.readouterr().out
    assert said.startswith('effect_missing coulomb_friction\n')
    errors = [float(e) for e in re.findall(r'([\d.]+) % held-out error', said)]
    assert len(errors) == 2
    assert errors[1] < 0.5 * errors[0]
    assert load_model(tmp_path / 'model.yaml').effects == ('coulomb_friction',)


def test_the_effect_shown_is_a_whole_one(tmp_path: Path) -> None:
    path = tmp_path / 'readme_drag.py'
    path.write_text(block_with('CARD'))
    effect = add_effect_file(path)
    catalogue().pop(effect.key)
    np.testing.assert_allclose(effect.laws['torque'](-3.0, 0.5), 4.5)
