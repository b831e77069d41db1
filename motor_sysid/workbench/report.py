"""The page: as a report its view and its assets in one file that needs nothing else."""

from base64 import b64encode
import hashlib
from importlib.resources import files
import json
from pathlib import Path

from motor_sysid.diagnosis.result.result import Diagnosis
from motor_sysid.whole_file import write_whole
from motor_sysid.workbench.schema import View
from motor_sysid.workbench.view import build_view

STYLES = ('uPlot.min.css', 'style.css')
SCRIPTS = (
    'uPlot.iife.min.js', 'base.js', 'strip.js', 'traces.js', 'pictures.js', 'where.js',
    'tables.js', 'verdict.js', 'differences.js', 'unknown.js', 'app.js',
)  # fmt: skip
"""Assets in the order in which the page needs them."""


def write_report(diagnosis: Diagnosis, path: str | Path) -> Path:
    """Write a diagnosis as one self-contained HTML file and return its path.

    The file opens offline and asks for nothing; its content security policy forbids any request
    and any script but its own.
    """
    return write_view_report(build_view(diagnosis), path)


def write_view_report(view: View, path: str | Path) -> Path:
    """Write the report of a view that was built or loaded before and return its path."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, report_html(view))
    return target


def report_html(view: View) -> str:
    """Return the text of the report."""
    return _page(f'<script type="application/json" id="view">{_embedded(view)}</script>')


def page_html() -> str:
    """Return the text of the page that asks the server it comes from for its view."""
    return _page('', "connect-src 'self'")


def _page(view: str, *allowed: str) -> str:
    styles = [asset(name) for name in STYLES]
    scripts = [asset(name) for name in SCRIPTS]
    slots = {
        'policy': _policy(styles, scripts, *allowed),
        'styles': '\n'.join(f'<style>{style}</style>' for style in styles),
        'view': view,
        'scripts': '\n'.join(f'<script>{script}</script>' for script in scripts),
    }
    page = asset('index.html')
    for name, text in slots.items():
        page = page.replace(f'<!-- slot: {name} -->', text)
    return page


def asset(name: str) -> str:
    """Return the text of one of the page's files."""
    return (files('motor_sysid.workbench') / 'assets' / name).read_text(encoding='utf-8')


def _embedded(view: View) -> str:
    """Return JSON that cannot end the script element it stands in."""
    text = json.dumps(view, allow_nan=False, separators=(',', ':'))
    return text.replace('<', '\\u003c')


def _policy(styles: list[str], scripts: list[str], *allowed: str) -> str:
    """Return a policy that allows exactly these styles and scripts, and no request beyond."""
    parts = (
        "default-src 'none'",
        'img-src data:',
        f'style-src {_hashes(styles)}',
        f'script-src {_hashes(scripts)}',
        *allowed,
    )
    return f'<meta http-equiv="Content-Security-Policy" content="{"; ".join(parts)}">'


def _hashes(texts: list[str]) -> str:
    digests = (hashlib.sha256(text.encode()).digest() for text in texts)
    return ' '.join(f"'sha256-{b64encode(digest).decode()}'" for digest in digests)
