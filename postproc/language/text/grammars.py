"""Grammars of all languages, and the parsers made from them."""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from contextlib import suppress
from functools import cache
from io import BytesIO
from pathlib import Path

import lark

from postproc.files import replace_file
from postproc.operating_system import is_private

_PACKAGE = Path(__file__).resolve().parents[2]
_OPTIONS = {"parser": "lalr", "lexer": "contextual", "maybe_placeholders": False}


def grammar(name: str) -> str:
    """Return the text of a grammar, from the package or from beside it.

    A wheel carries the grammars inside of the package; an editable install reads them
    where they are kept.
    """
    for folder in (_PACKAGE / "grammars", _PACKAGE.parent / "grammars"):
        path = folder / f"{name}.lark"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise FileNotFoundError(f"grammar {name}.lark is not installed")


@cache
def line_parser(name: str, start: str) -> lark.Lark:
    """Return the LALR parser of a grammar, its tables from an earlier run if kept."""
    text = grammar(name)
    key = key_of(text, start, repr(_OPTIONS), lark.__version__, sys.version)
    data = read_kept(key)
    if data is not None:
        with suppress(Exception):  # whatever is wrong with it, it can be made
            return lark.Lark.load(BytesIO(data))
    made = lark.Lark(text, start=start, **_OPTIONS)
    tables = BytesIO()
    made.save(tables)
    keep(key, tables.getvalue())
    return made


# Parser tables kept between runs, in the user's cache folder.
#
# Making the tables of PDL2 takes most of a second, reading them back a tenth of that.
# They are kept under a key of all that they are made from, so none is ever out of date.
# Where a file cannot be read, written or trusted, tables are made anew and nothing is
# said: a cache that fails costs time, never a program.

SIZE = hashlib.sha256().digest_size  # of the digest that a file begins with


def folder() -> Path | None:
    """Return the folder for what is kept, None where the user has none."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(given):
        return Path(given) / "postproc"
    with suppress(RuntimeError):  # no home
        home = Path.home()
        if home.is_absolute() and home.is_dir():
            return home / ".cache" / "postproc"
    return None


def key_of(*parts: str) -> str:
    """Name what is made from some texts.

    >>> key_of("a", "bc") == key_of("ab", "c")
    False
    """
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def read_kept(key: str) -> bytes | None:
    """Return what was kept under a key; None where nothing whole of ours is there."""
    place = folder()
    if place is None:
        return None
    try:
        if not is_private(place.stat()):
            return None
        with open(place / key, "rb", opener=_open_file) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode) or not is_private(status):
                return None
            digest, data = file.read(SIZE), file.read()
    except OSError:
        return None
    return data if hashlib.sha256(data).digest() == digest else None


def _open_file(path: str, flags: int) -> int:
    """Open what stands there itself, and never wait for it, as for a FIFO."""
    flags |= getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0)
    return os.open(path, flags)


def keep(key: str, data: bytes) -> None:
    """Keep something under a key, if that is possible.

    It is renamed into place: processes that start at once never see half of it.
    """
    place = folder()
    if place is None:
        return
    with suppress(OSError):
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        with replace_file(place / key) as file:
            file.write(hashlib.sha256(data).digest() + data)
