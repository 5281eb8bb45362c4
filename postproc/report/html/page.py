"""One self-contained page: template, style, scripts and data in one text."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import jinja2
from markupsafe import Markup

from postproc import __version__

# Text from files, made safe to look at.

# Controls, marks that reorder or hide text, and halves of surrogate pairs: whoever
# reads the page must see them, and no viewer may act on them.
_HIDDEN = re.compile(
    "[\x00-\x08\x0a-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e"
    "\u2060-\u206f\ud800-\udfff\ufeff\ufff9-\ufffb]"
)
TAB = 4  # columns


def visible(text: str) -> str:
    r"""Show control characters and reordering marks as escapes.

    >>> visible("p\x1b[31m1")
    'p\\x1b[31m1'
    >>> visible("a\u202eb")
    'a\\u202eb'
    """
    if text.isascii() and text.isprintable():
        return text
    return _HIDDEN.sub(_escape, text.expandtabs(TAB))


def _escape(found: re.Match[str]) -> str:
    """Write one character as an escape."""
    code = ord(found.group())
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def short(text: str, limit: int) -> str:
    """Cut a text that is too long to show.

    >>> short("MOVE TO p1", 6)
    'MOVE …'
    """
    return text if len(text) <= limit else text[: limit - 1] + "…"


# One self-contained page: template, style, scripts and data in one text.

PLAIN_BYTES = 3_000_000  # data up to this size stay readable in the file
SYSTEM, ANY_SYSTEM = 9, 255  # byte of a gzip header (RFC 1952), and none in particular
PLAIN, PACKED = "application/json", "application/gzip"

# No plotly server, no fonts from elsewhere, no formula renderer: nothing to fetch.
_SETTINGS = 'window.PlotlyConfig = {MathJaxConfig: "local"};'


def render(
    template: str,
    title: str,
    payload: Mapping[str, Any],
    scripts: Sequence[str],
    **context: object,
) -> str:
    """Make a page that opens from disk and asks the network for nothing.

    Every text in `context` is escaped by the template; the payload reaches the scripts
    as data. The page's own policy lets exactly its own scripts run, so text from a
    program could not run even if an escape were missing. plotly.js stands in the page
    compressed: a page that is mailed or moved alone shows everything.

    Args:
        template: Name in ``templates/``.
        title: Of the page.
        payload: What the scripts show; JSON values without NaN.
        scripts: Names in ``assets/``, in order.
        **context: What the template shows.

    Raises:
        KeyError: The template needs something that the context lacks.
    """
    code = [_SETTINGS, *(asset(name) for name in scripts)]
    kind, data = embed(payload)
    page = _environment().get_template(template)
    try:
        return page.render(
            title=title,
            version=__version__,
            style=Markup(asset("style.css")),  # our own file
            code=[Markup(text) for text in code],  # our own files
            policy=policy([*code, plotly_js()]),
            library=packed_plotly(),
            data=data,
            data_kind=kind,
            **context,
        )
    except jinja2.UndefinedError as exc:
        raise KeyError(str(exc)) from None


def embed(payload: Mapping[str, Any]) -> tuple[str, Markup]:
    """Write data so that it can stand inside a script element.

    Returns:
        The type of the element and its content: JSON without any ``<``, ``>`` or
        ``&``, or, where that would be large, the same compressed, in base 64.
    """
    text = json.dumps(payload, separators=(",", ":"), allow_nan=False)
    if len(text) > PLAIN_BYTES:
        return PACKED, pack(text)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return PLAIN, Markup(text)  # nothing of HTML is left in it


def pack(text: str) -> Markup:
    """Compress text, and write it in base 64: a third to two fifths of its size."""
    packed = bytearray(gzip.compress(text.encode("utf-8"), compresslevel=5, mtime=0))
    packed[SYSTEM] = ANY_SYSTEM  # as every Python from 3.13 on writes it
    return Markup(base64.b64encode(packed).decode("ascii"))  # nothing of HTML is in it


def policy(code: Sequence[str]) -> str:
    """State what the page may do: run these scripts, draw, and nothing else."""
    digests = [hashlib.sha256(text.encode()).digest() for text in code]
    hashes = " ".join(f"'sha256-{base64.b64encode(d).decode()}'" for d in digests)
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; "
        "img-src data: blob:; form-action 'none'; base-uri 'none'"
    )


@cache
def asset(name: str) -> str:
    """Read a file of ``assets/``."""
    return (
        files("postproc.report.html")
        .joinpath("assets", name)
        .read_text(encoding="utf-8")
    )


@cache
def plotly_js() -> str:
    """Return the whole of plotly.js: its basic bundle draws neither boxes nor space."""
    place = files("plotly").joinpath("package_data", "plotly.min.js")
    return place.read_text(encoding="utf-8")


@cache
def packed_plotly() -> Markup:
    """Return plotly.js as it stands in a page."""
    return pack(plotly_js())


@cache
def _environment() -> jinja2.Environment:
    """Make the environment: everything is escaped, nothing undefined passes."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader("postproc.report.html"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=lambda value: visible(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
    )
