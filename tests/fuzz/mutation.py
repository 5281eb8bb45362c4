"""Damage to texts: what disks, editors, mail and hurried people do to programs."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

Kind = Callable[[random.Random, bytes], bytes]
ENCODINGS = ("utf-8", "utf-8-sig", "cp437", "utf-16-le")
WORDS = (
    b"IF", b"THEN", b"ENDIF", b"FOR", b"TO", b"DO", b"ENDFOR", b"END", b"BEGIN",
    b"ROUTINE", b"CYCLE", b"GOTO", b"MOVE", b"MOVEFLY", b"LINEAR", b"VIA", b"WITH",
    b"ENDMOVE", b"VAR", b"POS(", b"{", b"}", b"[", b"]", b"(", b")", b"'", b'"',
    b"--", b"::", b":=", b"..", b",", b"\\", b"0x", b"1e9", b"1e308", b"999999999",
    b"-", b".", b"\xef\xbb\xbf", b"$TOOL", b"$UFRAME", b"RELATIVE", b"ADVANCE",
)  # fmt: skip

RAPID_WORDS = (
    b"MODULE", b"PROC", b"ENDPROC", b"MoveL", b"MoveC", b"SearchL", b"Offs(",
    b"RelTool(", b"CONST robtarget", b"VAR num", b"IF", b"THEN", b"ENDIF", b"FOR",
    b"DO", b"ENDFOR", b"GOTO", b"ERROR", b"PDispOn", b"ConfL\\Off;", b"%%%", b"!",
    b'"', b";", b":=", b"\\", b"\\WObj:=", b"[", b"]", b"{", b"}", b"9E9", b"0x1F",
    b"1e308", b"-", b",", b"o_p1", b"\xef\xbb\xbf",
)  # fmt: skip

KRL_WORDS = (
    b"DEF", b"END", b"ENDFCT", b"DEFDAT", b"PTP", b"LIN", b"CIRC", b"SLIN", b"SPLINE",
    b"ENDSPLINE", b"CA", b"C_DIS", b"LIN_REL", b"DECL E6POS", b"INT", b"IF", b"THEN",
    b"ENDIF", b"FOR", b"TO", b"ENDFOR", b"LOOP", b"ENDLOOP", b"EXIT", b"GOTO",
    b"WAIT SEC", b"INTERRUPT DECL 5 WHEN", b"DO", b"$TOOL=", b"$BASE=", b"BAS(#FRAMES)",
    b"WITH", b"EK(", b"&", b";", b"'B01'", b"#TCP", b"$", b"{", b"}", b"[", b"]",
    b":", b"\"", b"=", b"==", b"E1 5", b"S 18", b"1e308", b"-", b",", b"\xef\xbb\xbf",
)  # fmt: skip


def _lines(data: bytes) -> list[bytes]:
    return data.splitlines(keepends=True) or [b""]


def flip(rng: random.Random, data: bytes) -> bytes:
    """Change one byte."""
    at = rng.randrange(len(data))
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def drop(rng: random.Random, data: bytes) -> bytes:
    """Lose a few lines."""
    lines = _lines(data)
    at = rng.randrange(len(lines))
    return b"".join(lines[:at] + lines[at + rng.randrange(1, 4) :])


def double(rng: random.Random, data: bytes) -> bytes:
    """Repeat a block of lines, once or many times."""
    lines = _lines(data)
    at = rng.randrange(len(lines))
    end = at + rng.randrange(1, 12)
    times = rng.choice([2, 2, 2, 3, 30])
    return b"".join([*lines[:at], *lines[at:end] * times, *lines[end:]])


def shuffle(rng: random.Random, data: bytes) -> bytes:
    """Put a line somewhere else."""
    lines = _lines(data)
    line = lines.pop(rng.randrange(len(lines)))
    lines.insert(rng.randrange(len(lines) + 1), line)
    return b"".join(lines)


def cut(rng: random.Random, data: bytes) -> bytes:
    """Lose the end."""
    return data[: rng.randrange(len(data) + 1)]


def recode(rng: random.Random, data: bytes) -> bytes:
    """Save a part in another encoding."""
    start, end = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    text = data[start:end].decode("latin-1")
    return data[:start] + text.encode(rng.choice(ENCODINGS), "replace") + data[end:]


def endings(rng: random.Random, data: bytes) -> bytes:
    """Give some lines other endings, or join them with the next."""
    new = (b"\n", b"\r\n", b"\r", b" ", b"\n\r", b"\x0b", b"\x1a")
    lines = _lines(data)
    for _ in range(rng.randrange(1, 5)):
        at = rng.randrange(len(lines))
        lines[at] = lines[at].rstrip(b"\r\n") + rng.choice(new)
    return b"".join(lines)


def insert(rng: random.Random, data: bytes) -> bytes:
    """Put a word of the language where it does not belong."""
    at = rng.randrange(len(data) + 1)
    return data[:at] + b" " * rng.randrange(2) + rng.choice(WORDS) + data[at:]


def number(rng: random.Random, data: bytes) -> bytes:
    """Write another number where one stands."""
    digits = [i for i, byte in enumerate(data) if 48 <= byte <= 57]
    if not digits:
        return data
    at = rng.choice(digits)
    new = (b"0", b"1e9", b"100000", b"-1", b"1e400", b"0x7FFFFFFF", b"9" * 30, b"nan")
    return data[:at] + rng.choice(new) + data[at + 1 :]


def stretch(rng: random.Random, data: bytes) -> bytes:
    """Make one line very long."""
    lines = _lines(data)
    at = rng.randrange(len(lines))
    lines[at] = lines[at].rstrip(b"\r\n") * rng.choice([2, 8, 40]) + b"\n"
    return b"".join(lines)


KINDS: tuple[Kind, ...] = (
    flip, flip, drop, double, shuffle, cut, recode, endings, insert, insert, number,
    stretch,
)  # fmt: skip


def insert_rapid(rng: random.Random, data: bytes) -> bytes:
    """Put a word of RAPID where it does not belong."""
    at = rng.randrange(len(data) + 1)
    return data[:at] + b" " * rng.randrange(2) + rng.choice(RAPID_WORDS) + data[at:]


def insert_krl(rng: random.Random, data: bytes) -> bytes:
    """Put a word of KRL where it does not belong."""
    at = rng.randrange(len(data) + 1)
    return data[:at] + b" " * rng.randrange(2) + rng.choice(KRL_WORDS) + data[at:]


KRL_KINDS = tuple(insert_krl if kind is insert else kind for kind in KINDS)
RAPID_KINDS = tuple(insert_rapid if kind is insert else kind for kind in KINDS)


def mutated(
    rng: random.Random, data: bytes, most: int = 4, kinds: Sequence[Kind] = KINDS
) -> bytes:
    """Damage a text one to `most` times."""
    for _ in range(rng.randint(1, most)):
        if data:
            data = rng.choice(kinds)(rng, data)
    return data
