"""A structure as YAML or JSON and back, to the last bit: schema ``motor_sysid/structure/1``."""

from collections.abc import Mapping
import json

import numpy as np
import yaml

from motor_sysid.errors import UserError
from motor_sysid.structures.base import Structure
from motor_sysid.structures.kinds import KINDS

SCHEMA = 'motor_sysid/structure/1'

_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
_DUMPER = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)


def to_document(structure: Structure) -> dict[str, object]:
    """Return what a file holds, of plain types."""
    s = structure
    return {
        'schema': SCHEMA,
        'kind': s.kind,
        'title': KINDS[s.kind].title,
        'inputs': list(s.inputs),
        'outputs': list(s.outputs),
        'dt_s': s.dt,
        'orders': list(s.orders),
        'input_size': s.input_size.tolist(),
        'output_size': s.output_size.tolist(),
        'parts': [{k: np.asarray(v).tolist() for k, v in part.items()} for part in s.parts],
    }


def of_document(content: object) -> Structure:
    """Return the structure that `to_document` described.

    Raises
    ------
    UserError
        If it is none, or of an unknown kind.
    """
    if not isinstance(content, Mapping) or content.get('schema') != SCHEMA:
        raise UserError(f'no structure: expected a mapping with `schema: {SCHEMA}`')
    if content.get('kind') not in KINDS:
        raise UserError(
            f'unknown structure `{content.get("kind")}`; known are {", ".join(KINDS)}'
        )
    try:
        return Structure(
            content['kind'], tuple(content['inputs']), tuple(content['outputs']),
            float(content['dt_s']), tuple(int(n) for n in content['orders']),
            np.array(content['input_size'], dtype=float),
            np.array(content['output_size'], dtype=float),
            tuple({k: _array(v) for k, v in part.items()} for part in content['parts']),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError) as problem:
        raise UserError(f'a structure with a broken or missing entry: {problem}') from None


def _array(value: object) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array(value, dtype=np.float64)


def dump_yaml(structure: Structure) -> str:
    """Return the YAML text of a structure; floats in their shortest exact form."""
    return yaml.dump(to_document(structure), Dumper=_DUMPER, sort_keys=False, width=99)


def dump_json(structure: Structure) -> str:
    """Return the JSON text of a structure."""
    return json.dumps(to_document(structure))


def parse(text: str) -> Structure:
    """Return the structure of a YAML or JSON text.

    Raises
    ------
    UserError
        If it is not one.
    """
    try:
        return of_document(yaml.load(text, Loader=_LOADER))
    except yaml.YAMLError as problem:
        raise UserError(f'not a YAML file: {" ".join(str(problem).split())}') from problem
