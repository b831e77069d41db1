"""Open a recording of any kind as records: ``load('bag_folder')``, ``load('data.csv.gz')``."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.recording.arrays import read_arrays, SUFFIXES
from motor_sysid.recording.bag_rows import rows_of_bag
from motor_sysid.recording.headers import config_from_headers
from motor_sysid.recording.msg_config import load_msg_config, said_of_shipped
from motor_sysid.recording.rosbag import Bag, is_bag
from motor_sysid.recording.rows import records_from, Rows
from motor_sysid.recording.sources import MsgConfig, Source
from motor_sysid.recording.sparse import joined
from motor_sysid.recording.table import read_table
from motor_sysid.recording.table_rows import rows_of_table
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]

VOLTAGE, DUTY = 'voltage', ('duty', 'supply_voltage')

WRITTEN = {'.yaml', '.yml', '.json'}
"""Suffixes of models and results, which are no recordings."""

KINDS = 'a bag folder, .mcap, .db3, CSV, CSV.GZ, .mat or .npz'
"""What a recording may be, in words."""


@dataclass(frozen=True)
class Loaded:
    """What was read from one recording.

    Attributes
    ----------
    records:
        One for each uninterrupted stretch, in order.
    findings:
        What had to be mended, left out or assumed on the way.
    source:
        The path as it was given.
    origins:
        Signal to where it came from, in words.
    """

    records: tuple[Record, ...]
    findings: tuple[Finding, ...]
    source: str
    origins: Mapping[str, str]


def load(
    path: str | Path, msg_config: str | Path | MsgConfig | None = None, *, namespace: str = ''
) -> Loaded:
    """Read a rosbag2 folder, ``.mcap``, ``.db3``, CSV, CSV.GZ, ``.mat`` or ``.npz``.

    Parameters
    ----------
    path:
        The recording.
    msg_config:
        File that says which topic or column carries which signal, or the name of one that ships
        with the package.  Default: the topics of this package, or headers that bear their unit.
    namespace:
        Prefix of the topics, where a bag has several robots.

    Raises
    ------
    UserError
        If nothing can be read; the message says why and what to do.
    """
    path = Path(path)
    if not path.exists():
        raise UserError(f'{path} does not exist; DATA is {KINDS}')
    if path.suffix == '.bag':
        raise UserError(f'{path} is a ROS 1 bag; convert it with rosbags-convert')
    if path.suffix in WRITTEN:
        raise UserError(
            f'{path} is no recording (models are .yaml, results .json); DATA is {KINDS}. Give a '
            'model where the verb takes one: `--model`, or before DATA'
        )
    try:
        config = _config(msg_config)
        if is_bag(path):
            return _load_bag(path, config or load_msg_config('default'), namespace)
        if path.is_dir():
            raise UserError(f'{path} is a folder without .mcap, .db3 or metadata.yaml: no bag')
        return _load_table(path, config)
    except OSError as error:
        raise UserError(f'{path} cannot be read: {error.strerror or error}') from None


def _config(msg_config: str | Path | MsgConfig | None) -> MsgConfig | None:
    if msg_config is None or isinstance(msg_config, MsgConfig):
        return msg_config
    return load_msg_config(msg_config)


def _load_bag(path: Path, config: MsgConfig, namespace: str) -> Loaded:
    if namespace:
        config = replace(config, namespace=namespace.strip('/'))
    bag = Bag(path)
    parts, chosen, findings = rows_of_bag(bag, config)
    origins = {name: f'{topic.name} {s.field}' for name, (s, topic) in chosen.items()}
    return _finished(path, config, parts, origins, [*bag.findings, *findings])


def _load_table(path: Path, config: MsgConfig | None) -> Loaded:
    table = read_arrays(path) if path.suffix.lower() in SUFFIXES else read_table(path)
    findings: list[Finding] = []
    if config is None:
        config, findings = config_from_headers(
            str(path), table.names, table.dated, said_of_shipped
        )
    parts, chosen = rows_of_table(table, config)
    origins = {name: source.describe() for name, source in chosen.items()}
    findings = [*findings, *table.findings]
    aligned: list[Rows] = []
    for part in parts:
        rows, told = joined(part, config.base_clock)
        aligned += rows
        findings += told
    return _finished(path, config, aligned, origins, findings)


def _finished(
    path: Path, config: MsgConfig, parts: list[Rows], origins: dict[str, str],
    findings: list[Finding],
) -> Loaded:  # fmt: skip
    """Add what is computed, clean, and cut into records."""
    computed = [s for s in config.all_sources() if s.derived]
    provenance = Provenance(str(path))
    records: list[Record] = []
    for part in parts:
        rows, used = _with_computed(part, computed)
        rows, told = _with_voltage(rows)
        origins |= {source.signal: source.describe() for source in used}
        findings = [*findings, *told]
        new, more = records_from(rows, provenance, config.max_gap)
        records += new
        findings = findings + more
    if records and VOLTAGE in records[0] and VOLTAGE not in origins:
        origins[VOLTAGE] = ' * '.join(DUTY)
    if not records or not records[0].signals:
        reasons = ' '.join(f'{finding.message}.' for finding in findings)
        raise UserError(
            f'{path} has no two complete samples in a row; record a few seconds. {reasons}'
        )
    kept = {n: text for n, text in origins.items() if any(n in record for record in records)}
    return Loaded(tuple(records), _unique(findings), str(path), kept)


def _with_computed(rows: Rows, computed: list[Source]) -> tuple[Rows, list[Source]]:
    """Add products, sums and constants, in the order in which they need each other.

    Returns
    -------
    tuple
        The rows, and the sources that were used: those of signals that had no other.
    """
    signals, units, used = dict(rows.signals), dict(rows.units), list[Source]()
    waiting = list(computed)
    while ready := [s for s in waiting if all(part in signals for part in s.parts)]:
        for source in ready:
            if source.signal not in signals:
                signals[source.signal] = source.to_si(_combined(source, signals, rows.time))
                units[source.signal] = source.si_unit()
                used.append(source)
        waiting = [source for source in waiting if source not in ready]
    missing = [s for s in waiting if not s.optional and s.signal not in signals]
    if missing:
        lacking = [part for part in missing[0].parts if part not in signals]
        raise UserError(
            f'`{missing[0].signal}` is computed from {", ".join(lacking)}, which the data lacks'
        )
    kept = {name: values for name, values in signals.items() if not name.startswith('_')}
    return replace(rows, signals=kept, units=units), used


def _with_voltage(rows: Rows) -> tuple[Rows, list[Finding]]:
    """Add the voltage that a duty cycle makes of a supply voltage, where none is recorded."""
    known = set(rows.signals)
    if not known.issuperset(DUTY) or any(name.startswith(VOLTAGE) for name in known):
        return rows, []
    duty, supply = (rows.signals[name] for name in DUTY)
    finding = Finding(
        Severity.INFO, 'voltage_computed', 'the voltage is duty times supply voltage',
        'a bridge that brakes between its pulses makes that of them',
        'name another source of the voltage in a msg_config file if there is one',
    )  # fmt: skip
    signals = {**rows.signals, VOLTAGE: duty * supply}
    return replace(rows, signals=signals, units={**rows.units, VOLTAGE: 'V'}), [finding]


def _combined(source: Source, signals: Mapping[str, Array], time: Array) -> Array:
    if source.constant is not None:
        return np.full(time.size, source.constant)
    stack = np.array([signals[part] for part in source.parts])
    combined = np.prod(stack, axis=0) if source.product else np.sum(stack, axis=0)
    return np.asarray(combined, dtype=np.float64)


def _unique(findings: list[Finding]) -> tuple[Finding, ...]:
    """Drop findings that say the same twice."""
    return tuple({(finding.code, finding.message): finding for finding in findings}.values())
