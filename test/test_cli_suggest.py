"""`motor-sysid suggest`: the page's tour runs as it stands, and bad input is refused."""

import json
from pathlib import Path
import re
import shlex

import pytest

from motor_sysid.cli import main
from motor_sysid.control.profile_file import load_profile
from motor_sysid.physics.model import Model
from motor_sysid.physics.store import save_model

PAGE = (Path(__file__).resolve().parent.parent / 'docs' / 'suggest.md').read_text()


def block(language: str, word: str) -> str:
    """Return the one block of the page in this language that has this word."""
    (found,) = (
        b for b in re.findall(rf'```{language}\n(.*?)```', PAGE, flags=re.DOTALL) if word in b
    )
    return found


@pytest.fixture(scope='module')
def toured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the tour of the page in a folder of its own and return the folder."""
    folder = tmp_path_factory.mktemp('tour')
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path('forward.yaml').write_text(block('yaml', 'name: forward'))
        for line in block('sh', 'suggest linear.yaml').splitlines():
            program, *arguments = shlex.split(line)
            assert program == 'motor-sysid'
            assert main(arguments) == 0, line
    return folder


def test_the_tour_ends_with_the_truth(toured: Path) -> None:
    experiment = json.loads((toured / 'suggestion.json').read_text())['experiment']
    assert experiment['decides']
    assert experiment['expected'][0]['delta_bic'] >= 40
    assert experiment['duration_s'] <= 6.0
    profile, limits = load_profile(toured / 'next.yaml')
    assert profile.duration == pytest.approx(experiment['duration_s'])
    assert {'input', 'speed', 'current'} == set(limits)
    values = profile.sampled(0.002)
    assert values.min() < 0 < values.max(), 'it turns round'
    found = json.loads((toured / 'diagnosis.json').read_text())
    assert found['effects'] == ['asymmetric_coulomb_friction']


def test_the_python_of_the_page_runs(
    toured: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(toured)
    exec(compile(block('python', 'suggest('), 'suggest.md', 'exec'), {})
    said = capsys.readouterr().out
    assert re.match(r'narrows the standard deviation of J from [\d.]+ % to [\d.]+ % in', said)


def test_a_diagnosis_names_the_rivals_and_a_table_is_written(
    toured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    candidates = [
        {'effect': 'coulomb_friction', 'confusable_with': ['constant_load_torque']},
    ]
    document = {'effects': ['coulomb_friction'], 'candidates': candidates}
    (tmp_path / 'd.json').write_text(json.dumps(document))
    out = tmp_path / 'next.csv'
    data = [str(toured / 'linear.yaml'), str(toured / 'forward.csv')]
    given = ['--diagnosis', str(tmp_path / 'd.json'), '--time', '2', '-o', str(out)]
    assert main(['suggest', *data, *given]) == 0
    said = capsys.readouterr().out
    assert re.search(r'[Ss]eparates Coulomb friction from constant load torque', said)
    assert out.read_text().startswith(('time [s],speed_reference [rad/s]', 'time [s],voltage [V]'))
    assert load_profile(out)[0].duration <= 2.0
    assert 'a CSV holds the profile alone; write YAML for limits' in said
    assert ('-p kp:=' in said) is out.read_text().startswith('time [s],speed_reference')
    assert re.search(r'Predicted peaks, worst rival: input [\d.]+ V, speed [\d.]+ rad/s', said)


def test_where_there_is_nothing_to_do_no_file_is_written_and_that_is_said(
    toured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'next.yaml'
    data = [str(toured / 'linear.yaml'), str(toured / 'forward.csv')]
    assert main(['suggest', *data, '--parameters', 'J', '--current', '1e-6', '-o', str(out)]) == 0
    said = capsys.readouterr().out
    assert f'{out} is not written: there is no experiment to do' in said
    assert not out.exists()


def test_a_motor_with_several_inputs_is_refused_in_words(
    toured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also one whose inputs are not recorded but derived."""
    model = tmp_path / 'axis.yaml'
    save_model(Model.base('inverse_axis'), model)
    assert main(['suggest', str(model), str(toured / 'forward.csv'), '--parameters', 'J']) == 2
    assert 'experiments need a motor with one input' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('given', 'message'),
    [
        (['--rivals', 'coulomb_friction'], 'name at least two'),
        (['--rivals', 'witchcraft', 'none'], 'witchcraft'),
        (['--parameters', 'K'], 'no parameter `K`'),
        (['--parameters', 'J', '--speed', '-3'], 'speed is -3 rad/s (m/s); give more than 0'),
        (['--diagnosis', '/nowhere.json'], '/nowhere.json'),
    ],
)
def test_bad_input_ends_with_code_2_and_a_reason(
    toured: Path, capsys: pytest.CaptureFixture[str], given: list[str], message: str
) -> None:
    data = [str(toured / 'linear.yaml'), str(toured / 'forward.csv')]
    assert main(['suggest', *data, *given]) == 2
    assert message in capsys.readouterr().err
