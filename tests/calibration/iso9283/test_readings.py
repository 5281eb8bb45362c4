"""Readings of a test after ISO 9283: tables, programs, and what is wrong with them."""

from __future__ import annotations

import json

import pytest

from tests.written import cli

HEAD = "pose,cycle,x_cmd_mm,y_cmd_mm,z_cmd_mm,x_mm,y_mm,z_mm"
GOOD = ("P1,1,0,0,0,0.3,0,0.4", "P1,2,0,0,0,0.3,0,0.4", "P1,3,0,0,0,0.3,0,0.4")
ALONG = "path,s_mm,cycle,x_cmd_mm,y_cmd_mm,z_cmd_mm,x_mm,y_mm,z_mm"


def table(tmp_path, *rows, head=HEAD, name="r.csv"):
    place = tmp_path / name
    place.write_text("\n".join((head, *rows, "")))
    return place


def test_a_table_as_text_json_and_page(tmp_path):
    place, page = table(tmp_path, *GOOD), tmp_path / "r.html"
    done = cli("iso9283", place, "--load", "90 kg", "--speed", "0.2 m/s")
    assert done.exit_code == 0, done.stderr
    assert "load 90 kg, speed 0.2 m/s" in done.stdout
    assert "P1 at 0.000, 0.000, 0.000 mm" in done.stdout
    assert "after ISO 9283" in done.stdout
    assert "not an ISO value: 3 of 30 cycles" in done.stdout
    said = json.loads(cli("iso9283", place, "--report", "-").stdout)
    ap = said["after"]["values"][0]
    assert (ap["name"], ap["count"], ap["iso"]) == ("AP", 3, False)
    assert ap["mm"] == pytest.approx(0.5) and said["load"] is None
    assert cli("iso9283", place, "--report", page).exit_code == 0
    assert "not an ISO value: 3 of 30 cycles" in page.read_text()


def test_before_stands_beside_after(tmp_path):
    place = table(tmp_path, *GOOD)
    worse = table(tmp_path, *(r.replace("0.4", "4") for r in GOOD), name="b.csv")
    said = json.loads(cli("iso9283", place, "--before", worse, "--report", "-").stdout)
    assert said["before"]["values"][0]["mm"] > said["after"]["values"][0]["mm"]
    assert [f["path"] for f in said["files"]] == ["r.csv", "b.csv"]
    told = cli("iso9283", place, "--before", worse).stdout
    assert "before mm" in told and "4.0112" in told and "0.5000" in told


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (("P1,1.5,0,0,0,0,0,1",), "r.csv:2: cycle 1.5 is no whole number. Number the"),
        (
            (GOOD[0], "P1,2,0,0,1,0,0,1"),
            "r.csv:3: the command of P1 is another than on",
        ),
        ((GOOD[0], GOOD[0]), "r.csv:3: cycle 1 of P1 is on line 2 already. Number the"),
        ((GOOD[0], ",2,0,0,0,0,0,1"), "r.csv:3: the row names no pose. Name its pose"),
        ((GOOD[0], "P1,2,0,0,0,x,0,1"), "r.csv:3: 'x' in column x_mm is not a number"),
    ],
)
def test_wrong_rows(tmp_path, rows, said):
    done = cli("iso9283", table(tmp_path, *rows), "--report", tmp_path / "out.json")
    assert done.exit_code == 2 and said in done.stderr
    assert not (tmp_path / "out.json").exists()


@pytest.mark.parametrize(
    ("head", "rows", "said"),
    [
        (HEAD.replace("x_cmd", "u"), GOOD, "column x_cmd_mm is missing"),
        (HEAD.replace("pose", "p"), GOOD, "column path, s_mm is missing"),
        (ALONG, ("L,,1,0,0,0,0,0,0",), "r.csv:2: s_mm is empty in a row of a path"),
        (ALONG, ("L,0,1,0,0,0,0,0,0",), "r.csv:2: cycle 1 of path L has one reading"),
        (
            ALONG,
            ("L,0,1,0,0,0,0,0,0", "L,1,1,1,0,0,1,0,0", "L,0,2,0,1,0,0,0,0"),
            "r.csv:4: the command of path L at 0.000 mm is another than on line 2",
        ),
    ],
)
def test_wrong_tables(tmp_path, head, rows, said):
    done = cli("iso9283", table(tmp_path, *rows, head=head))
    assert done.exit_code == 2 and said in done.stderr


def test_a_path_in_a_table(tmp_path):
    rows = [f"L,{s},{n},{s},0,0,{s},0,0.5" for n in (1, 2, 3) for s in (0, 10, 20)]
    said = json.loads(
        cli("iso9283", table(tmp_path, *rows, head=ALONG), "--report", "-").stdout
    )
    values = {v["name"]: v for v in said["after"]["values"]}
    assert values["AT"]["mm"] == pytest.approx(0.5, abs=1e-9)
    assert values["RT"]["mm"] == pytest.approx(0.0, abs=1e-9)
    assert values["AT"]["remark"] == "not an ISO value: 3 of 10 cycles"
