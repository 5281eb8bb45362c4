"""Programs of a folder that change what others share are programs of the batch, too."""

from __future__ import annotations

from pathlib import Path

import pytest

from postproc.batch.plan import make_plan
from postproc.batch.tree import scan
from postproc.compensation.options import Options
from postproc.files import FolderListing
from postproc.language.languages import language_of
from postproc.language.text.source import Source
from postproc.language.text.stamp import stamp_line
from tests.golden.case import HERE

KRL = {
    "R1/System/$config.dat": "DEFDAT $CONFIG\nBASE_DATA[1]={X 1}\nENDDAT\n",
    "R1/Program/a.src": "DEF a( )\nBASE_DATA[1].X=5\nLIN XP1\nEND\n",
    "R1/Program/a.dat": "DEFDAT a\nDECL E6POS XP1={X 1}\nENDDAT\n",
    "R1/Program/b.src": "DEF b( )\nLIN XP1\nEND\n",
    "R1/Program/b.dat": "DEFDAT b\nDECL E6POS XP1={X 1}\nENDDAT\n",
}
WOBJ = 'PERS wobjdata w:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'
RAPID = {
    "a.mod": "MODULE a\nPROC a()\nw.uframe.trans.x:=5;\nENDPROC\nENDMODULE\n",
    "b.mod": f"MODULE b\n{WOBJ}\nPROC b()\nMoveL p,v5,fine,tool0\\WObj:=w;\nENDPROC\n"
    "ENDMODULE\n",
}  # fmt: skip

PDL2 = {
    "a.pdl": "PROGRAM a\nVAR f : POSITION EXPORTED FROM b\nBEGIN\nf.X := 5\nEND a\n",
    "b.pdl": "PROGRAM b\nVAR f : POSITION EXPORTED FROM b\nBEGIN\nMOVE TO f\nEND b\n",
}


@pytest.mark.parametrize(
    ("files", "programs"),
    [(PDL2, ("a.pdl", "b.pdl")),
     (KRL, ("R1/Program/a.src", "R1/Program/b.src")),
     (RAPID, ("a.mod", "b.mod"))],
)  # fmt: skip
def test_a_program_that_others_read_is_compensated(tmp_path, files, programs):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    given = [HERE / "rapid" / name for name in ("cell.toml", "model.json")]
    found = scan(tmp_path, make_plan(None, *given, Options()))
    reads = {unit.program: unit.reads for unit in found.units}
    changing, changed = programs
    assert reads.keys() == {*programs}
    assert changing in reads[changed] and changed not in reads[changing]


@pytest.mark.parametrize("files", [KRL, RAPID, PDL2])
def test_what_programs_share_is_looked_for_once_a_folder(tmp_path, monkeypatch, files):
    for k in range(40):
        for name, text in files.items():
            copy = tmp_path / name.replace("b.", f"b{k}.")
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(text)
    opened, read = [], Path.open
    monkeypatch.setattr(Path, "open", lambda *a, **k: opened.append(a) or read(*a, **k))
    given = [HERE / "rapid" / name for name in ("cell.toml", "model.json")]
    plan = make_plan(None, *given, Options())
    found = scan(tmp_path, plan)
    count = len(opened)
    assert len(found.units) >= 40 and count < 20 * 40
    listing, (first, *_) = FolderListing(tmp_path), found.units
    language_of(first.program).reads(tmp_path / first.program, listing)
    opened.clear()
    for unit in found.units:
        language_of(unit.program).reads(tmp_path / unit.program, listing)
    assert len(opened) <= len(found.units)  # but for each program itself


@pytest.mark.parametrize("files", [KRL, RAPID, PDL2])
def test_outputs_count_unless_their_sources_stand_beside_them(tmp_path, files):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    changing, changed = (next(n for n in files if n.split("/")[-1][:2] == w)
                         for w in ("a.", "b."))  # fmt: skip
    path, source = tmp_path / changing, (tmp_path / changing).read_bytes()
    stamp = stamp_line("0", "m", Source(path.name, source), comment_of(path))
    path.write_bytes(stamp + source)

    def reads():
        found = language_of(changed).reads(tmp_path / changed, FolderListing())
        return path in found

    assert reads()
    path.with_stem("old").write_bytes(source)
    assert not reads()


def comment_of(path):
    return language_of(path.name).comment
