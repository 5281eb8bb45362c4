"""Variable files in the forms in which they are found."""

import numpy as np

from postproc.language.language import Start
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import read_variables
from postproc.language.text.number_edits import edits
from postproc.language.text.source import apply, source_from_bytes

LSV = b"""--$$  ARM: 1 AXES: 8 AUX: 1 MASK: 191
one XTND Arm: 1 Ax:1 Priv X: 1093.44 Y: 636.79  Z:345.13 A: -135 E: 56 R: 38 1: 90
XTN2 XTND Arm: 1 Ax: 1 Xport from other NoSave
 X: 1.00  Y: 2.00  Z: 3.00  A: 4.00  E: 5.00  R: 6.00  1: 90
 CNFG: 'W T1:1'
tab APOS [3] Priv
 [1]: X: 1 Y: 2 Z: 3 A: 4 E: 5 R: 6 CNFG: ''
 [2]
   X: ******* Y: ******* Z:****** A:*** E:** R:**
   CNFG: ''
j JNTP Arm: 1 AX: 7 Priv
 1:  0.00 2: -20.00 3: -110.00 4:  0.00 5:  60.00 6:  0.00 7:  90.00
n INT Priv
 2
b BOO Priv
 FALSE
twice POS Priv X: 1 Y: 2 Z: 3 A: 4 E: 5 R: 6 CNFG: ''
twice POS Priv X: 1 Y: 2 Z: 3 A: 4 E: 5 R: 6 CNFG: ''
far POS Arm: 2 Priv X: 1 Y: 2 Z: 3 A: 4 E: 5 R: 6 CNFG: ''
cut POS Priv
 X: 1 Y: 2 Z: 3
"""
PDL = b"""PROGRAM job
VAR One, xtn2 : XTNDPOS FOR ARM[1]
  tab : ARRAY[3] OF POSITION
  j : JOINTPOS
  twice, cut, far : POSITION
BEGIN
  MOVE LINEAR TO one
  MOVE LINEAR TO xtn2
  MOVE LINEAR TO tab[1]
  MOVE LINEAR TO tab[n]
  MOVE JOINT TO j
  MOVE LINEAR TO twice
  MOVE LINEAR TO cut
  MOVE LINEAR TO far
END job
"""


def resolved(lsv: bytes = LSV):
    variables = read_variables(source_from_bytes("job.lsv", lsv))
    program = parse(source_from_bytes("job.pdl", PDL))
    return resolve(program, Start(aux={1: "gun"}), variables), variables


def test_values_and_their_places() -> None:
    found, variables = resolved()
    v = found.visits
    assert v.files == ("job.pdl", "job.lsv")
    own = [True, True, True, False, True] + [False] * 3
    assert (v.target.literal >= 0).tolist() == own
    assert v.target.values[0].tolist() == [1093.44, 636.79, 345.13, -135, 56, 38]
    assert v.target.values[4].tolist() == [0, -20, -110, 0, 60, 0]
    assert v.target.aux[0, 0] == v.target.aux[4, 0] == 90
    assert v.target.configs[v.target.config[1]] == "W T1:1"
    assert v.literals.file.tolist() == [1] * 4
    assert v.literals.shared.tolist() == [False, True, False, False]
    start, end = v.literals.places.start, v.literals.places.end
    text = variables.source.text
    spans = zip(start[0], end[0], strict=True)
    assert [float(text[a:b]) for a, b in spans] == v.target.values[0].tolist()


def test_what_is_wrong_is_said() -> None:
    found, _ = resolved()
    v = found.visits
    reasons = [v.reasons[i].text for i in v.reason]
    assert "not initialised" in reasons[3]
    assert "no value" in reasons[5]
    assert "not initialised" in reasons[6]
    assert "arm 2" in reasons[7]
    codes = {d.code for d in found.diagnostics if d.file == "job.lsv"}
    assert codes == {
        "lsv-duplicate",
        "lsv-incomplete",
        "lsv-uninitialised",
        "lsv-undeclared",
        "lsv-unused",
    }


def test_edits_fall_into_the_variable_file() -> None:
    found, variables = resolved()
    v = found.visits
    program = source_from_bytes("job.pdl", PDL)
    new = v.target.values[:1] + np.array([0.5, 0, 0, 0, 0, 0])
    pdl, lsv = edits(
        v.literals, (program, variables.source), v.target.literal[:1], new, PDL2_DIALECT
    )
    assert not pdl
    assert apply(LSV, lsv) == LSV.replace(b"1093.44", b"1093.940")


def test_a_file_of_another_program_is_noticed() -> None:
    found, _ = resolved(b"zzz POS Priv X: 1 Y: 2 Z: 3 A: 4 E: 5 R: 6 CNFG: ''\n")
    assert "lsv-other-program" in {d.code for d in found.diagnostics}


def test_an_auxiliary_axis_must_be_declared() -> None:
    variables = read_variables(source_from_bytes("job.lsv", LSV))
    program = parse(source_from_bytes("job.pdl", PDL))
    for aux, word in (({}, "not declared"), ({1: "track"}, "track")):
        v = resolve(program, Start(aux=aux), variables).visits
        assert word in v.reasons[v.reason[0]].text
        assert v.target.literal[0] >= 0
