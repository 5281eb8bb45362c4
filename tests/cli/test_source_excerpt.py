"""Messages show the line they speak of, with a caret under the place."""

from __future__ import annotations

import pytest

from postproc.cli.source_excerpt import WIDTH, excerpt, point_at
from postproc.exceptions import CellError, MeasurementError, ProgramError
from tests.written import FIRST, POSE, cli, program

FAR = "MOVE LINEAR TO POS(9000.0, 0.0, 0.0, 0.0, 175.0, 0.0, '')"


def pointed(shown: str) -> str:
    """Return what stands over the caret and its tail."""
    source, under = shown.splitlines()
    start, end = under.index("^"), len(under)
    return source[start:end]


def test_the_caret_stands_under_the_text():
    line = "abc,1.25,xyz"
    assert pointed(excerpt(line, 7, 5, 4)) == "1.25"
    assert pointed(excerpt("\t\tMOVE", 7, 1, 6)) == "MOVE"
    assert pointed(excerpt("x", 7, 40)) == ""


@pytest.mark.parametrize("at", [0, 20, 100, 480])
def test_long_lines_are_cut_around_the_caret(at):
    line = "".join(f"{k:05d}" for k in range(100))
    shown = excerpt(line, 3, at + 1, 5)
    assert pointed(shown) == line[at : at + 5]
    assert max(map(len, shown.splitlines())) <= WIDTH + 10


def test_control_characters_are_shown_not_obeyed():
    shown = excerpt("a\x1b[2J 'b'", 1, 1)
    assert "\x1b" not in shown and "\\x1b[2J" in shown


def test_the_quoted_cell_of_a_table_is_pointed_at(tmp_path):
    (tmp_path / "a.csv").write_text("id,x\n1,2\n2,abc\n")
    error = MeasurementError(tmp_path / "a.csv", "'abc' is no number", line=3)
    assert pointed(point_at(error)) == "abc"


@pytest.mark.parametrize(
    ("place", "shown"),
    [
        ("$.tool.xyz_mm", "xyz_mm"),
        ("$.tool.xyz_mm[2]", "xyz_mm"),
        ("$.tool.source", "[tool]"),
        ("$.joint[2].lower", "lower"),
        ("$.frames.tf.1,2", "1,2"),
        ("$.nothing", None),
    ],
)
def test_places_in_a_cell_file(place, shown, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(
        '[robot]\narm = "x"\n[tool]\nxyz_mm = [1, 2]\n[[joint]]\nlower = 1\n'
        '[[joint]]\nlower = 2\n[frames.tf]\n"1,2" = {}\n'
    )
    found = point_at(CellError(path, "wrong", place=place))
    assert (pointed(found) if shown else found) == (shown or "")
    if "joint" in place:
        assert found.lstrip().startswith("8 |")


def test_the_column_of_a_syntax_error(tmp_path):
    cell = tmp_path / "cell.toml"
    cell.write_text('[robot]\narm = "nj\n')
    (tmp_path / "job.pdl").write_bytes(program(FIRST))
    found = cli("explain", tmp_path / "job.pdl", "--cell", cell)
    assert found.exit_code == 2 and 'arm = "nj\n' in found.stderr
    assert found.stderr.rstrip().endswith("^")


def test_nothing_is_shown_of_a_file_that_is_not_there():
    assert point_at(ProgramError("gone.pdl", "wrong", line=3)) == ""


def test_bare_names_are_found_among_the_files_of_the_command(tmp_path):
    (tmp_path / "job.pdl").write_bytes(program(FIRST))
    error = ProgramError("job.pdl", "wrong", line=5)
    assert point_at(error) == ""
    assert "MOVE JOINT" in point_at(error, (None, tmp_path / "job.pdl"))


def test_targets_left_alone_are_shown_with_their_numbers(desk):
    source = desk.put("job.pdl", program(FIRST, FAR, POSE, "MOVE LINEAR TO r"))
    told = desk.compensate(source, "-o", desk.folder / "out.pdl").stderr
    lines = told.splitlines()
    at = next(k for k, line in enumerate(lines) if "6: rejected" in line)
    assert pointed("\n".join(lines[at + 1 : at + 3])).startswith("9000.0, 0.0")
    assert "8 |   MOVE LINEAR TO r" in told


def test_unterminated_strings_show_their_line(desk):
    source = desk.put("job.pdl", program(FIRST, "s := 'abc", POSE))
    told = desk.compensate(source).stderr
    assert "6 |   s := 'abc" in told
