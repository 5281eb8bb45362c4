"""Parser tables kept between runs, in the user's cache folder.

Making the tables of PDL2 takes most of a second, reading them back a tenth of that.
They are kept under a key of all that they are made from, so none is ever out of date.
Where a file cannot be read, written or trusted, tables are made anew and nothing is
said: a cache that fails costs time, never a program.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from contextlib import suppress
from pathlib import Path

OTHERS_WRITE = 0o022  # permission bits of group and others
SIZE = hashlib.sha256().digest_size  # of the digest that a file begins with


def folder() -> Path | None:
    """Return the folder for what is kept, None where the user has none."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(given):
        return Path(given) / "postproc"
    with suppress(RuntimeError):  # no home
        return Path.home() / ".cache" / "postproc"
    return None


def key_of(*parts: str) -> str:
    """Name what is made from some texts.

    >>> key_of("a", "bc") == key_of("ab", "c")
    False
    """
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def kept(key: str) -> bytes | None:
    """Return what was kept under a key; None where nothing whole of ours is there."""
    place = folder()
    if place is None:
        return None
    try:
        with (place / key).open("rb") as file:
            if not _is_ours(os.fstat(file.fileno())):
                return None
            digest, data = file.read(SIZE), file.read()
    except OSError:
        return None
    return data if hashlib.sha256(data).digest() == digest else None


def _is_ours(status: os.stat_result) -> bool:
    """Tell whether nobody but this user can have written a file."""
    if not hasattr(os, "geteuid"):  # Windows: the folder is the user's own
        return True
    return status.st_uid == os.geteuid() and not status.st_mode & OTHERS_WRITE


def keep(key: str, data: bytes) -> None:
    """Keep something under a key, if that is possible.

    It is renamed into place: processes that start at once never see half of it.
    """
    place = folder()
    if place is None:
        return
    with suppress(OSError):
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=place)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(data).digest() + data)
            os.replace(temporary, place / key)
        except OSError:
            os.unlink(temporary)
            raise
