"""Files read again with other numbers say what they say when read by themselves."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.language.language import Start
from postproc.language.pdl2 import language
from postproc.language.pdl2.language import Pdl2
from postproc.language.text.source import Source

PROGRAMS = Path(__file__).parents[3] / "programs"
HEAD = b"PROGRAM job\nVAR p, q : POSITION\n n : INTEGER\nBEGIN\n"
JOB = HEAD + b"MOVE LINEAR TO POS(1, 2, 3, 4, 5, 6, '')\nMOVE TO p\n"
LSV = b"p POS Priv\n X: 1 Y: 2 Z: 3\n A: 4 E: 5 R: 6\n CNFG: ''\nn INT Priv 7\n"


def sources(program: bytes, values: bytes) -> list[Source]:
    return [Source("job.pdl", program), Source("job.lsv", values)]


def same_reading(program: bytes, values: bytes) -> bool:
    """Read a job again; tell whether it was built anew; it must read as alone."""
    first = Pdl2().read(sources(JOB, LSV), Start())
    again = Pdl2().read(sources(program, values), Start(), first.programs)
    alone = Pdl2().read(sources(program, values), Start())
    assert again.diagnostics == alone.diagnostics
    for part in (*again.visits.parts, "graph"):
        a, b = vars(getattr(again.visits, part)), vars(getattr(alone.visits, part))
        for name in a:
            np.testing.assert_equal(a[name], b[name], err_msg=name)
    for name in ("files", "reason", "reasons"):
        a, b = getattr(again.visits, name), getattr(alone.visits, name)
        np.testing.assert_equal(a, b, err_msg=name)
    for name, column in vars(again.visits.literals).items():
        other = getattr(alone.visits.literals, name)
        if name == "places":
            column, other = vars(column), vars(other)
        np.testing.assert_equal(column, other)
    return again.texts[0].shapes is first.texts[0].shapes


STAMPED = b"-- postproc\n" + JOB.replace(b"(1, 2", b"(1.5, -2") + b"END job\n"
JOB += b"END job\n"


@pytest.mark.parametrize("values", [LSV, LSV.replace(b"Y: 2", b"Y: 2.25")])
def test_other_numbers_of_targets(values: bytes) -> None:
    assert same_reading(STAMPED, values)
    assert same_reading(JOB, values)


def test_a_value_that_gets_lost_and_one_beside_targets() -> None:
    same_reading(JOB, LSV.replace(b"Y: 2", b"Y: 1e999"))
    same_reading(JOB, LSV.replace(b"Priv 7", b"Priv 8"))
    same_reading(JOB, LSV.replace(b"Z: 3", b"Z: ****"))
    same_reading(JOB, LSV.replace(b"p POS", b"q POS"))


def test_other_numbers_of_declarations() -> None:
    other = JOB.replace(b"PROGRAM job", b"PROGRAM job PROG_ARM=1")
    first = Pdl2().read([Source("job.pdl", other)], Start(arm=1))
    moved = Source("job.pdl", other.replace(b"ARM=1", b"ARM=2"))
    with pytest.raises(language.ProgramError, match="arm 2"):
        Pdl2().read([moved], Start(arm=1), first.programs)


def test_findings_move_with_a_stamp() -> None:
    odd = JOB.replace(b"MOVE TO p", b"?? 1\nMOVE TO p")
    first = Pdl2().read([Source("job.pdl", odd)], Start())
    stamped = Source("job.pdl", b"-- postproc\n" + odd)
    again = Pdl2().read([stamped], Start(), first.programs)
    assert again.diagnostics == Pdl2().read([stamped], Start()).diagnostics
    assert any(d.code == "unknown-statement" for d in again.diagnostics)


def test_the_demo_s_spots_read_again() -> None:
    files = [
        Source(name, (PROGRAMS / name).read_bytes())
        for name in ("spot.pdl", "spot.lsv")
    ]
    first = Pdl2().read(files, Start())
    other = replace(files[1], data=files[1].data.replace(b"X: -", b"X: -1"))
    again = Pdl2().read([files[0], other], Start(), first.programs)
    alone = Pdl2().read([files[0], other], Start())
    assert not np.array_equal(again.visits.target.values, first.visits.target.values)
    np.testing.assert_equal(again.visits.target.values, alone.visits.target.values)
