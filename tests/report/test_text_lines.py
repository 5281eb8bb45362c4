"""Lines cut out of a file are those of a split."""

from __future__ import annotations

import pytest

from postproc.report.diff import TextLines


@pytest.mark.parametrize("data", [b"", b"\n", b"one", b"a\nbc\n\nd\n", b"\n\n\nlast"])
def test_lines_are_those_of_a_split(data: bytes) -> None:
    wanted = data.split(b"\n")
    lines = TextLines.of(data)
    assert len(lines) == len(wanted) and list(lines) == wanted
    assert [lines[k] for k in range(len(wanted))] == wanted
    assert lines[-1] == wanted[-1]
    for some in (slice(1, 3), slice(0, 0), slice(2, 99), slice(None, None, -1)):
        assert lines[some] == wanted[some]
    with pytest.raises(IndexError):
        lines[len(wanted)]
    assert list(TextLines.of(data, 1)) == wanted[1:]
    for begin, end in ((0, 0), (0, len(wanted)), (1, max(len(wanted), 1))):
        assert list(lines.part(begin, end)) == wanted[begin:end]
