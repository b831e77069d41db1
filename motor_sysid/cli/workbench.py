"""`motor-sysid workbench`: the page of a diagnosis, on which effects are added and removed."""

import argparse
import socket
import sys
from threading import Thread
import webbrowser

from motor_sysid.cli.common import progress, whole
from motor_sysid.cli.diagnose import add_question_arguments, question_of, summary, write_result
from motor_sysid.errors import UserError

HELP = 'diagnose, and open a page on which effects are added and removed at a click'
PORT = 8080


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_question_arguments(parser)
    parser.add_argument(
        '--port', type=whole('--port', 0, 65535), default=PORT, metavar='N',
        help='TCP port on this machine; 0: any that is free (default: %(default)d)',
    )  # fmt: skip
    parser.add_argument('--open', action='store_true', help='open a browser, too')


def run(args: argparse.Namespace) -> int:
    """Diagnose, say where the page is, and serve it until Ctrl-C."""
    from motor_sysid.workbench.server import HOST, Workbench
    from motor_sysid.workbench.session import Session

    _refuse_taken(HOST, args.port)
    train, validation, asked = question_of(args)
    session = Session(train, validation, **asked, progress=progress())
    print('\n'.join(summary(session.diagnosis)))
    write_result(session.diagnosis, args.json)
    with Workbench(session, args.port) as bench:
        print(f'workbench: {bench.address} (Ctrl-C ends it)', flush=True)
        if args.open:
            Thread(target=_open, args=(bench.address,), daemon=True).start()
        try:
            bench.serve_forever()
        except KeyboardInterrupt:
            print()
    return 0


def _open(address: str) -> None:
    """Open a browser, and wait for it if it runs in the foreground."""
    if not webbrowser.open(address):
        print('note: no browser could be opened', file=sys.stderr)


def _refuse_taken(host: str, port: int) -> None:
    """Refuse a port that is taken before the diagnosis, which would be lost with it."""
    try:
        with socket.socket() as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.bind((host, port))
    except OSError as problem:
        raise UserError(
            f'cannot serve on port {port}: {problem.strerror}; choose another with --port'
        ) from problem
