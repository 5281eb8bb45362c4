"""Text from files, made safe to look at."""

from __future__ import annotations

import re

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
