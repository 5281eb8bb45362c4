"""Whatever the bytes, an answer and no traceback."""

import random
import time
from pathlib import Path

import numpy as np
import pytest

from postproc.exceptions import PostprocError
from postproc.language.flow import resolve
from postproc.language.lsv import read_variables
from postproc.language.rewrite import edits
from postproc.language.source import apply, source_from_bytes
from postproc.language.structure import parse
from tests.language.generator import Generator

CORPUS = [
    p.read_bytes() for p in sorted((Path(__file__).parents[1] / "corpus").iterdir())
]


def mutated(rng: random.Random, data: bytes) -> bytes:
    for _ in range(rng.randrange(1, 4)):
        lines = data.splitlines(keepends=True) or [b""]
        at = rng.randrange(len(lines))
        kind = rng.randrange(6)
        if kind == 0 and data:
            where = rng.randrange(len(data))
            data = data[:where] + bytes([rng.randrange(256)]) + data[where + 1 :]
        elif kind == 1:
            data = b"".join(lines[:at] + lines[at + 1 :])
        elif kind == 2:
            data = b"".join([*lines[:at], lines[at], *lines[at:]])
        elif kind == 3:
            data = data[: rng.randrange(len(data) + 1)]
        elif kind == 4:
            data = data.replace(lines[at], lines[at].decode("latin-1").encode("utf-8"))
        else:
            other = rng.choice(lines)
            data = data.replace(lines[at], lines[at].rstrip() + b" " + other, 1)
    return data


@pytest.mark.parametrize("seed", range(400))
def test_mutated_programs(seed: int) -> None:
    rng = random.Random(seed)
    text = Generator(rng).program().text.encode("latin-1")
    data = mutated(rng, rng.choice([text, text, *CORPUS]))
    begun = time.process_time()
    try:
        source = source_from_bytes("f.pdl", data)
        visits = resolve(parse(source)).visits
        both = read_variables(source)
    except PostprocError:
        return
    assert time.process_time() - begun < 2.0
    assert (both.start <= both.end).all()
    rows = np.arange(len(visits.literals))
    known = {int(visits.literal[i]): visits.values[i] for i in range(len(visits))}
    same = edits(visits.literals, (source,), rows, [known[int(r)] for r in rows])
    assert apply(data, same[0]) == data


@pytest.mark.parametrize("text", ["((((" * 3000, "a+" * 3000, "'" * 9999, "{" * 5000])
def test_deep_and_long_lines(text: str) -> None:
    source = source_from_bytes("f", f"PROGRAM a\nBEGIN\nx := {text}\nEND a".encode())
    begun = time.process_time()
    try:
        resolve(parse(source))
    except PostprocError:
        pass
    assert time.process_time() - begun < 2.0
