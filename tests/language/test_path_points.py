"""Points on ways in every language: the same ones, and every byte given back."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from postproc.language.language import Language
from postproc.language.languages import language_of
from tests.language.neutral_job import LANGUAGES
from tests.language.neutral_ways import CHAIN
from tests.language.true_paths import compensated, deviations, surveyed
from tests.written import cli

ARM = 62
PLACES = {
    "job.mod": re.compile(rb"\[\[(-?[\d.]+),(-?[\d.]+),(-?[\d.]+)\]"),
    "job.src": re.compile(rb"\{X (-?[\d.]+),Y (-?[\d.]+),Z (-?[\d.]+)"),
    "job.pdl": re.compile(rb"POS\((-?[\d.]+), (-?[\d.]+), (-?[\d.]+)"),
}


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """A surveyed arm, and lines and an arc compensated in every language."""
    folder = tmp_path_factory.mktemp("ways")
    cell = surveyed(folder, ARM, poses=80)
    return cell, {name: compensated(folder, cell, name, 3, 1) for name in LANGUAGES}


@pytest.fixture(scope="module")
def chained(shop):
    """A chain of fly points, compensated for the same arm in every language."""
    cell, _ = shop
    folder = cell.parent / "chain"
    return cell, {name: compensated(folder, cell, name, 0, 0, 1) for name in LANGUAGES}


def inserted(place: Path, name: str) -> list[bytes]:
    language: Language = language_of(name)
    lines = (place / "points" / name).read_bytes().splitlines()
    return [line for line in lines if language.is_inserted(line)]


def test_the_points_are_the_same(shop):
    _, places = shop
    found = [
        {place for line in inserted(folder, name) for place in spots(name, line)}
        for name, folder in places.items()
    ]
    first = np.array(sorted(found[0]))
    assert len(first) > 5
    for other in found[1:]:
        np.testing.assert_allclose(np.array(sorted(other)), first, atol=0.005)


def spots(name: str, line: bytes) -> list[tuple[float, ...]]:
    """Return the places that a line names [mm]."""
    return [tuple(map(float, place)) for place in PLACES[name].findall(line)]


def test_the_arm_keeps_closer_to_its_paths(shop):
    cell, places = shop
    for name, place in places.items():
        plain, points = (
            deviations(place, cell, name, kind, ARM) for kind in ("plain", "points")
        )
        assert points.mean() < 0.6 * plain.mean()
        assert (points < plain + 0.05).all()


@pytest.mark.parametrize("name", LANGUAGES)
def test_the_source_comes_back_byte_for_byte(shop, name, tmp_path):
    _, places = shop
    again = tmp_path / name
    assert cli("restore", places[name] / "points" / name, "-o", again).exit_code == 0
    assert again.read_bytes() == (places[name] / name).read_bytes()


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_second_run_inserts_nothing(shop, name, tmp_path):
    cell, places = shop
    made = places[name] / "points" / name
    given = (
        "--cell",
        cell,
        "--model",
        cell.parent / "model.json",
        "-o",
        tmp_path / name,
    )
    found = cli("compensate", made, *given, "--path-tolerance", "0.1")
    assert found.exit_code == 2
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", LANGUAGES)
def test_what_is_inserted_is_shown_by_diff(shop, name):
    _, places = shop
    found = cli("diff", places[name] / name, places[name] / "points" / name)
    assert found.exit_code in (0, 1), found.output
    lines = found.output.splitlines()
    shown = [line for line in lines if "postproc: inserted" in line]
    assert len(shown) == len(inserted(places[name], name))
    assert float(re.findall(r"max ([\d.]+) mm", lines[-1])[0]) < 10.0


OLD = ((b"SLIN", b"LIN"), (b"SCIRC", b"CIRC"), (b"SPTP", b"PTP"))


@pytest.mark.parametrize(("zone", "points"), [("", 0), ("$APO.CDIS=2", 5)])
def test_old_moves_of_krl_get_points_where_blending_is_known(
    shop, tmp_path, zone, points
):
    cell, places = shop
    for part in ("job.src", "job.dat"):
        text = (places["job.src"] / part).read_bytes()
        for spline, old in OLD:
            text = text.replace(spline, old)
        text = text.replace(b"$VEL.CP", f"{zone}\r\n$VEL.CP".encode(), 1)
        (tmp_path / part).write_bytes(text)
    given = ("--cell", cell, "--model", cell.parent / "model.json")
    to = ("-o", tmp_path / "made.src", "--path-tolerance", "0.1")
    found = cli("compensate", tmp_path / "job.src", *given, *to)
    made = tmp_path / "made.src"
    assert made.exists(), found.output
    assert made.read_bytes().count(b"postproc: inserted") >= points
    assert ("set $APO.CDIS" in re.sub(r"\s+", " ", found.output)) is (points == 0)
    assert points or b"postproc: inserted" not in made.read_bytes()


def test_arcs_of_rapid_are_cut_in_the_usual_mode(shop, tmp_path):
    cell, places = shop
    text = (places["job.mod"] / "job.mod").read_bytes()
    usual = text.replace(b"    CirPathMode\\CirPointOri;\n", b"")
    (tmp_path / "job.mod").write_bytes(usual)
    given = ("--cell", cell, "--model", cell.parent / "model.json")
    to = ("-o", tmp_path / "made.mod", "--path-tolerance", "0.2")
    cli("compensate", tmp_path / "job.mod", *given, *to)
    made = (tmp_path / "made.mod").read_bytes()
    assert b"CirPathMode" in text and b"CirPathMode" not in made
    assert b"inserted (via)" in made


@pytest.mark.parametrize("name", LANGUAGES)
def test_chains_of_fly_points_get_points(chained, name, tmp_path):
    cell, places = chained
    place, again = places[name], tmp_path / name
    assert inserted(place, name)
    plain, points = (
        deviations(place, cell, name, kind, ARM) for kind in ("plain", "points")
    )
    assert len(points) == CHAIN and (points < plain + 0.05).all()
    assert (points - plain).min() < -0.05
    assert cli("restore", place / "points" / name, "-o", again).exit_code == 0
    assert again.read_bytes() == (place / name).read_bytes()
