"""YAML as people write it: UTF-8, no key twice, and what is wrong said in one line."""

from collections.abc import Hashable
from pathlib import Path

import yaml

from motor_sysid.errors import UserError

_MERGE = 'tag:yaml.org,2002:merge'


def read_utf8(path: Path) -> str:
    """Return the text of a file.

    Raises
    ------
    UserError
        If it cannot be read, or is not UTF-8.
    """
    try:
        return path.read_text(encoding='utf-8')
    except UnicodeDecodeError as problem:
        raise UserError(f'byte {problem.start + 1} is no UTF-8; save it as UTF-8') from None
    except OSError as problem:
        raise UserError(str(problem)) from None


def load_yaml(text: str) -> object:
    """Return what a YAML text holds, of plain types.

    Raises
    ------
    UserError
        If it is not YAML, or a key stands twice: YAML would let the last one win.
    """
    try:
        return yaml.load(text, _UniqueKeys)
    except (yaml.YAMLError, ValueError, RecursionError) as problem:  # a date such as 2025-13-01
        raise UserError(f'not a YAML file: {" ".join(str(problem).split())}') from None


class _UniqueKeys(yaml.SafeLoader):
    """A loader that refuses a key given twice."""

    def construct_mapping(
        self, node: yaml.MappingNode, deep: bool = False
    ) -> dict[Hashable, object]:
        seen: set[Hashable] = set()
        for key_node, _ in node.value:
            if key_node.tag == _MERGE:
                continue
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, Hashable):
                continue  # SafeLoader refuses it
            if key in seen:
                line = key_node.start_mark.line + 1
                raise UserError(f'key `{key}` stands twice, again in line {line}; leave one out')
            seen.add(key)
        return super().construct_mapping(node, deep)
