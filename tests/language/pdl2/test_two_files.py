"""A target whose numbers stand in two files has no one place that could be edited."""

import pytest

from postproc.language.language import JobReading
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import read_variables
from postproc.language.text.source import source_from_bytes

VALUES = b"""p POS Priv
 X: 1.5  Y: 2.5  Z: 3.5  A: 4.5  E: 5.5  R: 6.5
 CNFG: ''
q POS Priv
 X: 7.5  Y: 2.5  Z: 3.5  A: 4.5  E: 5.5  R: 6.5
 CNFG: ''
"""


def job(assigned: str) -> JobReading:
    text = f"PROGRAM job\nVAR p, q: POSITION\nBEGIN\n{assigned}\n"
    text += "MOVE LINEAR TO p\nMOVE LINEAR TO q\nEND job\n"
    values = read_variables(source_from_bytes("job.lsv", VALUES))
    return resolve(parse(source_from_bytes("job.pdl", text.encode())), None, values)


@pytest.mark.parametrize("component", "XYZAER")
def test_a_component_set_by_the_program_leaves_the_target_alone(component: str) -> None:
    visits = job(f"p.{component} := 9.25").visits
    assert visits.target.literal.tolist() == [-1, 0]
    assert "others in another file" in visits.reasons[visits.reason[0]].text
    assert visits.reason[1] == 0
    assert visits.target.values[0, "XYZAER".index(component)] == 9.25


def test_numbers_of_one_file_are_edited_where_they_stand() -> None:
    assert job("-- nothing").visits.target.literal.tolist() == [0, 1]
    own = ", ".join(f"{n}.25" for n in range(6))
    visits = job(f"p := POS({own}, '')\np.X := 9.25").visits
    assert (visits.target.literal >= 0).all()
    assert visits.reason.tolist() == [0, 0]
