"""The workbench: the page of a session on this machine, whose buttons change the model.

It answers on the loopback interface only, and only to a browser that asks for it by a loopback
name and acts from its own page: other machines come through ``ssh -L``, other sites not at all.
"""

from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
import json
import secrets
import sys
from threading import Lock
from urllib.parse import parse_qs, urlsplit

from motor_sysid.errors import UserError
from motor_sysid.physics.store import dump_model
from motor_sysid.workbench.report import page_html, report_html
from motor_sysid.workbench.schema import View
from motor_sysid.workbench.session import Session

HOST = '127.0.0.1'
NAMES = ('127.0.0.1', 'localhost')
"""Names by which a browser may ask: any other is somebody else's, pointed here."""

LONGEST = 4096
"""Bytes of a request's body."""


class Workbench(ThreadingHTTPServer):
    """Serves a session until `shutdown`.

    Parameters
    ----------
    session:
        The models; it is told what is going on.
    port:
        TCP port; 0 takes a free one.

    Raises
    ------
    UserError
        If the port is taken.
    """

    daemon_threads = True

    def __init__(self, session: Session, port: int = 0) -> None:
        try:
            super().__init__((HOST, port), _Answer)
        except (OSError, OverflowError) as problem:
            raise UserError(
                f'cannot serve on port {port}: {problem}; choose another with --port'
            ) from problem
        self.session = session
        self.session.tell = self._tell
        self.at_work = Lock()
        self.doing = ''
        self._birth = secrets.token_hex(4)
        self.view = session.view()

    @property
    def address(self) -> str:
        """URL of the page."""
        return f'http://{HOST}:{self.server_port}/'

    @property
    def state(self) -> dict[str, str]:
        """Which view there is, and what is being done."""
        return {'version': self.version_of(self.view), 'doing': self.doing}

    def version_of(self, view: View) -> str:
        """Return what tells a view from those before it, and from those of another start."""
        return f'{self._birth}-{len(view["steps"])}'

    def act(self, verb: str, step: int, effect: str) -> None:
        """Add or remove an effect; the view is a new one then.

        Raises
        ------
        UserError
            If something else is being done, or this cannot be.
        """
        if not self.at_work.acquire(blocking=False):
            raise UserError('another change is under way; wait for it')
        try:
            act = {'add': self.session.add, 'remove': self.session.remove}[verb]
            self.view = act(step, effect)
        finally:
            self.doing = ''
            self.at_work.release()

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing of a tab that was closed or reloaded before it had its answer."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)  # type: ignore[arg-type]

    def _tell(self, text: str) -> None:
        self.doing = text


class _Answer(BaseHTTPRequestHandler):
    """Answers one request."""

    server: Workbench
    protocol_version = 'HTTP/1.1'

    def do_GET(self) -> None:
        """Answer with the page, what it shows, or a file to keep."""
        if not self._is_ours():
            return
        try:
            url = urlsplit(self.path)
        except ValueError as problem:
            self._refuse(HTTPStatus.BAD_REQUEST, f'no such address: {problem}')
            return
        if url.path == '/':
            self._send(page_html().encode(), 'text/html')
        elif url.path == '/view.json':
            self._send_view()
        elif url.path == '/state.json':
            self._send_json(self.server.state)
        elif url.path == '/report.html':
            report = report_html({**self.server.view, 'actions': False, 'effects': []})
            self._send(report.encode(), 'text/html', 'report.html')
        elif url.path == '/model.yaml':
            self._send_model(parse_qs(url.query).get('step', [''])[0])
        else:
            self._refuse(HTTPStatus.NOT_FOUND, f'there is no {url.path}')

    def do_POST(self) -> None:
        """Change the model."""
        text = self.headers.get('Content-Length', '')
        size = _count(text)
        if size is None or size > LONGEST:
            self.close_connection = True
            self._refuse(HTTPStatus.BAD_REQUEST, f'a body of {text or "unknown"} bytes')
            return
        body = self.rfile.read(size)
        if not self._is_ours():
            return
        if self.headers.get('Origin') != f'http://{self.headers["Host"]}':
            self._refuse(HTTPStatus.FORBIDDEN, 'only the page itself may change the model')
            return
        verb = {'/actions/add': 'add', '/actions/remove': 'remove'}.get(self.path)
        if verb is None:
            self._refuse(HTTPStatus.NOT_FOUND, f'there is no {self.path}')
            return
        try:
            asked = json.loads(body)
            step, effect = int(asked['step']), str(asked['effect'])
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            self._refuse(HTTPStatus.BAD_REQUEST, 'the body is no {"step": ..., "effect": ...}')
            return
        try:
            self.server.act(verb, step, effect)
        except UserError as problem:
            self._refuse(HTTPStatus.CONFLICT, str(problem))
        except Exception as problem:
            why = f'this is a fault of motor_sysid, told in the terminal: {problem!r}'
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, why)
            raise
        else:
            self._send_view()

    def log_message(self, *args: object) -> None:
        """Say nothing: the terminal belongs to the progress of the work."""

    def _is_ours(self) -> bool:
        """Refuse whoever asks by a name that is not of this machine."""
        name = self.headers.get('Host', '').rsplit(':', 1)[0]
        if name in NAMES:
            return True
        self._refuse(HTTPStatus.FORBIDDEN, f'this is not {name}; ask for {self.server.address}')
        return False

    def _send_model(self, step: str) -> None:
        steps = self.server.session.diagnosis.steps
        number = _count(step)
        if number is None or number >= len(steps):
            self._refuse(HTTPStatus.NOT_FOUND, f'there is no model M{step}')
            return
        text = dump_model(steps[number].model).encode()
        self._send(text, 'application/yaml', f'model_M{number}.yaml')

    def _send_view(self) -> None:
        """Send what there is to see, with its version."""
        view = self.server.view
        self._send_json({**view, 'version': self.server.version_of(view)})

    def _send_json(self, document: object) -> None:
        self._send(json.dumps(document, allow_nan=False).encode(), 'application/json')

    def _refuse(self, status: HTTPStatus, why: str) -> None:
        self._send(why.encode(), 'text/plain', status=status)

    def _send(
        self, body: bytes, kind: str, name: str = '', status: HTTPStatus = HTTPStatus.OK
    ) -> None:
        self.send_response(status)
        self.send_header('Content-Type', f'{kind}; charset=utf-8')
        self.send_header('Content-Length', str(len(body)))
        self.send_header('Cache-Control', 'no-store')
        self.send_header('X-Content-Type-Options', 'nosniff')
        self.send_header('X-Frame-Options', 'DENY')
        if name:
            self.send_header('Content-Disposition', f'attachment; filename="{name}"')
        self.end_headers()
        with suppress(ConnectionError):  # the tab was closed before the answer came
            self.wfile.write(body)


def _count(text: str) -> int | None:
    """Return the number that a few digits are; None if they are none."""
    return int(text) if text.isdecimal() and len(text) < 6 else None
