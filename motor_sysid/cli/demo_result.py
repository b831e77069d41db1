"""What the demo does with its bag: diagnose, print the falling error, write the results."""

from dataclasses import dataclass, replace
from pathlib import Path
import time
from typing import TextIO

from motor_sysid.cli.common import progress
from motor_sysid.cli.diagnose import summary, usual_settings, write_result
from motor_sysid.cli.reading import load_data
from motor_sysid.physics.model import Model

SHORTEST = 0.1
"""Pieces shorter than this share of the longest, which a busy machine cuts off, are left out."""


@dataclass(frozen=True)
class Demo:
    """A recorded demo.

    Attributes
    ----------
    bag, out:
        The bag, and the folder for results.
    nominal:
        Model from the datasheet.
    begin:
        `time.monotonic()` at the start.
    json:
        Where to write the result too, or None.
    """

    bag: Path
    out: Path
    nominal: Model
    begin: float
    json: Path | TextIO | None


def finish(demo: Demo) -> int:
    """Diagnose the bag as anyone would, without being told what is hidden; write the results."""
    from motor_sysid.diagnosis import diagnose
    from motor_sysid.physics.store import save_model
    from motor_sysid.workbench.report import write_report

    pieces = load_data([demo.bag], None)
    longest = max(len(piece) for piece in pieces)
    records = [piece for piece in pieces if len(piece) >= SHORTEST * longest]
    began = time.perf_counter()
    found = diagnose(
        records,
        motor=demo.nominal.motor,
        nominal=demo.nominal.parameters.values(),
        settings=usual_settings(),
        progress=progress(),
    )
    found = replace(found, seconds=time.perf_counter() - began)
    print('\n'.join(summary(found)))
    save_model(found.model, demo.out / 'model.yaml')
    page = write_report(found, demo.out / 'report.html')
    print(f'\nbag:    {demo.bag}\nmodel:  {demo.out / "model.yaml"}\nreport: {page}')
    write_result(found, demo.out / 'diagnosis.json')
    write_result(found, demo.json)
    print(f'The whole demo took {time.monotonic() - demo.begin:.0f} s.')
    return 0
