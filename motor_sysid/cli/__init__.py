"""The command line: one verb per file, imported when it is called."""

import argparse
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
import errno
import importlib
import importlib.util
import io
import os
import sys
from typing import cast, Protocol

from motor_sysid import __doc__ as PURPOSE
from motor_sysid import __version__
from motor_sysid.errors import UserError
from motor_sysid.threads import use_one

VERBS = (
    'demo', 'simulate', 'check', 'fit', 'compare', 'diagnose', 'calibrate', 'add', 'learn',
    'suggest', 'monitor', 'fleet', 'replay', 'record', 'report', 'workbench', 'export',
    'benchmark', 'compile',
)  # fmt: skip
"""Every verb, in the order of the help; each is a module of this package."""

BAD_INPUT, INTERRUPTED, BROKEN_PIPE = 2, 130, 141
EPILOG = (
    '`motor-sysid VERB --help` explains a verb.  '
    'DATA is a rosbag2 folder, .mcap, .db3, CSV, CSV.GZ, .mat or .npz.'
)


class Verb(Protocol):
    """What the module of a verb defines."""

    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the arguments of the verb."""

    def run(self, args: argparse.Namespace) -> int:
        """Do it; returns the exit code."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit code (0 good, 2 bad input, 130 interrupted)."""
    use_one()
    _speak_as_can_be()
    arguments = sys.argv[1:] if argv is None else list(argv)
    try:
        args = _parser(arguments).parse_args(arguments)
        piped = getattr(args, 'json', None) is sys.stdout
        with redirect_stdout(sys.stderr) if piped else nullcontext():
            code = _verb(args.verb).run(args)
        sys.stdout.flush()
        return code
    except UserError as error:
        print(f'error: {error}', file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader (head, less) has seen enough
        _say_no_more()
        return BROKEN_PIPE
    except OSError as problem:
        full = problem.errno == errno.ENOSPC
        if full:
            _say_no_more()
        where = f'{problem.filename}: ' if problem.filename else ''
        remedy = '; make room and try again' if full else ''
        print(f'error: {where}{problem.strerror or problem}{remedy}', file=sys.stderr)
        return BAD_INPUT


def _speak_as_can_be() -> None:
    """Let a stream that has no sign for a character show a question mark, and go on."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors != 'backslashreplace':
            stream.reconfigure(errors='replace')


def _say_no_more() -> None:
    """Drop what is still to be said on stdout, which takes no more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser(arguments: Sequence[str]) -> argparse.ArgumentParser:
    """Build the parser; only the verb that is called is imported, for the help all of them."""
    parser = argparse.ArgumentParser(
        prog='motor-sysid', description=PURPOSE, epilog=EPILOG, allow_abbrev=False
    )
    parser.add_argument('--version', action='version', version=f'motor-sysid {__version__}')
    verbs = parser.add_subparsers(dest='verb', metavar='VERB', required=True)
    called = [name for name in VERBS if name in arguments[:1] and _exists(name)]
    for name in called or filter(_exists, VERBS):
        verb = _verb(name)
        one = verbs.add_parser(name, help=verb.HELP, description=verb.HELP, allow_abbrev=False)
        verb.add_arguments(one)
    return parser


def _verb(name: str) -> Verb:
    return cast(Verb, importlib.import_module(f'motor_sysid.cli.{name}'))


def _exists(name: str) -> bool:
    return importlib.util.find_spec(f'motor_sysid.cli.{name}') is not None
