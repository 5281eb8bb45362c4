"""Points on ways: the virtual arm keeps to its paths, and nothing else is touched."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from postproc.arrays import Floats
from postproc.compensation.paths import insertion_loop, prune, split_selection
from postproc.compensation.paths.arcs import is_arc
from postproc.compensation.paths.backlash_preload import TAKEN
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import AIM, PathPrediction
from postproc.compensation.paths.plan_outcomes import BEGINS
from postproc.compensation.paths.plan_rule import MoveDeviation
from postproc.compensation.paths.rounded_points import RoundedPoints
from postproc.model.backlash_width import ahead
from postproc.model.model import load_model
from postproc.report.simulation import _read, setup_of, simulate_file
from postproc.robot.cell import load_cell
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion
from postproc.simulation import DEFAULT, virtual_arm
from postproc.simulation.program import land
from tests.compensation.findings.test_approach_advice import job as approaches
from tests.compensation.paths.test_path_error import (
    ARM,
    CELL,
    LINES,
    SEED,
    START,
    done,
    drawn,
    fitted,
    job,
    pos,
)
from tests.written import cli

TOLERANCE = 0.1  # [mm]
STOPS, AGAIN = "compensation.preload_backlash=true", "compensation.reapproach=true"
SPEED = 50.0  # [mm/s] in the job
SHORTEST_MS = 50.0  # [limits] segment_ms, as it is unless set
INSERTED = b"postproc: inserted"


@cache
def timed() -> str:
    """The job at a speed that it says itself."""
    lines = job().split("\r\n")
    return "\r\n".join([*lines[:4], "  $LIN_SPD := 0.05", *lines[4:]])


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An arm surveyed, and a job with points on its ways, with and without stops."""
    folder = tmp_path_factory.mktemp("points")
    (folder / "job.pdl").write_bytes(timed().encode())
    (folder / "model.json").write_bytes(fitted())
    known(folder, "confirmed")
    asked = ("--path-tolerance", TOLERANCE)
    for name, more in (("plain", ()), ("points", asked),
                       ("stops", (*asked, "--set", STOPS))):  # fmt: skip
        compensated(folder, "job.pdl", name, *more)
        done("simulate", folder / f"{name}.pdl", "--cell", CELL, *ARM,
             "--reference", folder / "job.pdl", "--path",
             "--report", folder / f"{name}.true.json")  # fmt: skip
    return folder


def compensated(
    folder: Path, source: str, name: str, *more: object, model: str = "confirmed"
) -> dict[str, Any]:
    done("compensate", folder / source, "--cell", CELL, "--model",
         folder / f"{model}.json", "-o", folder / f"{name}.pdl",
         "--report", folder / f"{name}.json", *more)  # fmt: skip
    return told(folder, name)


def known(folder: Path, verdict: str) -> None:
    """Write the model as after a measured path that says so of every joint."""
    model = load_model(folder / "model.json")
    said = {str(joint): verdict for joint in range(1, 7)}
    replace(model, history=({"in_motion": said},)).save(folder / f"{verdict}.json")


def told(folder: Path, name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / f"{name}.json").read_bytes())
    return found


def lines_of(report: dict[str, Any], move: str = "LINEAR") -> list[dict[str, Any]]:
    return [path for path in report["path"] if path["move"] == move]


def real(folder: Path, name: str) -> dict[int, dict[str, Any]]:
    return {move["visit"]: move for move in told(folder, f"{name}.true")["path"]}


@pytest.mark.slow
def test_the_virtual_arm_keeps_closer_to_its_lines(shop: Path) -> None:
    sizes = {}
    for name in ("plain", "points", "stops"):
        true, own = real(shop, name), lines_of(told(shop, name))
        sizes[name] = np.array([true[path["visit"]]["max_mm"] for path in own])
        predicted = np.array([path["max_mm"]["after"] for path in own])
        assert np.abs(sizes[name] - predicted).max() < 0.1
    assert (sizes["points"] < sizes["plain"] + 0.05).all()
    assert sizes["points"].mean() < 0.85 * sizes["plain"].mean()
    assert sizes["stops"].mean() < 0.3 * sizes["plain"].mean()
    assert sizes["stops"].max() < 0.5 * sizes["plain"].max()


def test_a_stop_takes_up_all_play_at_once(shop: Path) -> None:
    report, true = lines_of(told(shop, "stops")), real(shop, "stops")
    early = [p for p in report if p["points"] and p["points"][0]["at_mm"] < 1.0]
    assert len(early) > LINES / 2
    assert all(p["points"][0]["at_mm"] <= 1e3 * max(TAKEN) + 1e-3 for p in early)
    assert all(true[p["visit"]]["max_mm"] < 1.2 * TOLERANCE for p in early)


def test_most_of_a_way_keeps_to_half_of_what_was_asked_for(shop: Path) -> None:
    true = real(shop, "stops")
    within = [
        true[path["visit"]]["p95_mm"] < TOLERANCE / 2
        for path in lines_of(told(shop, "stops"))
    ]
    assert np.mean(within) > 0.9


def test_a_stop_is_not_judged_as_a_rounded_point(shop: Path) -> None:
    without = {p["visit"]: p for p in lines_of(told(shop, "plain"))}
    begins = [
        path
        for path in lines_of(told(shop, "stops"))
        if without[path["visit"]]["max_mm"]["after"] > TOLERANCE
        and without[path["visit"]]["at_mm"]["after"] < 2.0
    ]
    assert len(begins) > 5
    assert all(path["inserted"] for path in begins)


def test_points_that_did_better_are_put_back(
    shop: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def worse(now: PathPrediction) -> InsertionPlan:
        plan = now.plan
        for v in [v for v in plan.points if not is_arc(now.task.visits, v)]:
            plan = plan.put(v, (0.5,))
        return plan

    monkeypatch.setattr(insertion_loop, "join_flat_pieces", worse)
    found = compensated(shop, "job.pdl", "put_back", "--path-tolerance", TOLERANCE)
    for old, new in zip(lines_of(told(shop, "points")), lines_of(found), strict=True):
        assert new["points"] == old["points"]


def test_flanks_that_a_measured_path_refutes_get_fewer_points(shop: Path) -> None:
    known(shop, "refuted")
    asked = ("--path-tolerance", TOLERANCE)
    paths = lines_of(compensated(shop, "job.pdl", "known", *asked, model="refuted"))
    confirmed = lines_of(told(shop, "points"))
    why = [path["insertion_skipped"] or "" for path in paths]
    assert sum("it would be worse by" in text and "if joint" in text for text in why)
    assert not any("if joint" in (p["insertion_skipped"] or "") for p in confirmed)
    many, few = (sum(p["inserted"] > 0 for p in own) for own in (confirmed, paths))
    assert few < 0.8 * many
    for refuted, usual in zip(paths, confirmed, strict=True):
        assert refuted["promise_mm"] >= usual["promise_mm"]


@pytest.fixture(scope="module")
def cautious(shop: Path) -> Path:
    """Points of a model that no measured path has judged."""
    asked = ("--path-tolerance", TOLERANCE)
    compensated(shop, "job.pdl", "cautious", *asked, model="model")
    return shop


def test_a_measured_path_that_does_not_tell_changes_nothing(cautious: Path) -> None:
    known(cautious, "uncertain")
    asked = ("--path-tolerance", TOLERANCE)
    compensated(cautious, "job.pdl", "untold", *asked, model="uncertain")
    texts = [(cautious / f"{n}.pdl").read_bytes().split(b"\n", 1)[1]
             for n in ("untold", "cautious")]  # fmt: skip
    assert texts[0] == texts[1]


def test_points_are_kept_beside_a_start_that_nothing_mends(shop: Path) -> None:
    report, without = lines_of(told(shop, "points")), lines_of(told(shop, "plain"))
    starts = [
        (path, plain)
        for path, plain in zip(report, without, strict=True)
        if plain["max_mm"]["after"] > 2 * TOLERANCE and path["at_mm"]["after"] < 2.0
    ]
    assert len(starts) > 5
    assert np.mean([bool(path["inserted"]) for path, _ in starts]) > 0.8


@pytest.mark.parametrize("gears", ["sharp", "elastic"])
def test_points_do_no_harm_where_no_measured_path_says_how_flanks_change(
    cautious: Path, gears: str
) -> None:
    assert any(path["inserted"] for path in told(cautious, "cautious")["path"])
    scores = []
    for name in ("cautious", "plain"):
        run = simulate_file(cautious / f"{name}.pdl", CELL, SEED, path=True,
                            gears=gears, reference=cautious / "job.pdl")  # fmt: skip
        assert run.paths is not None
        scores.append(run.paths)
    new, old = scores
    for k, visit in enumerate(new.visit.tolist()):
        before = int(np.searchsorted(old.visit, visit))
        here, there = (
            slice(one.first[i], one.first[i + 1])
            for one, i in ((new, k), (old, before))
        )
        usual = np.interp(new.way[here], old.way[there], old.across[there])
        far = new.way[here] > BEGINS  # where a move begins drives cross their gaps
        worse = (new.across[here] - usual)[far].max() / MM
        assert worse < 0.05
        assert new.across[here].max() < old.across[there].max() + 0.01 * MM


def test_a_link_ahead_of_its_drive_at_stops_is_not_sure_in_motion(shop: Path) -> None:
    model = load_model(shop / "model.json")
    arm = load_cell(CELL).arm
    assert not ahead(model, arm).any()
    braked = replace(model, values=np.where(
        [name.startswith("backlash.") for name in model.effects.names],
        -model.values, model.values,
    ))  # fmt: skip
    assert ahead(braked, arm).sum() > 3
    braked.save(shop / "braked.json")
    paths = lines_of(
        compensated(
            shop, "job.pdl", "slowed", "--path-tolerance", TOLERANCE, model="braked"
        )
    )
    why = [path["insertion_skipped"] or "" for path in paths]
    assert sum("it would be worse by" in text for text in why) > 3


def test_pieces_are_as_short_as_the_cell_says(shop: Path) -> None:
    text = CELL.read_text().replace("[limits]", "[limits]\nsegment_ms = 25.0")
    (shop / "short.toml").write_text(text)
    done("compensate", shop / "job.pdl", "--cell", shop / "short.toml", "--model",
         shop / "confirmed.json", "-o", shop / "short.pdl", "--report",
         shop / "short.json", "--path-tolerance", TOLERANCE)  # fmt: skip
    pieces = [
        step
        for path in lines_of(told(shop, "short"))
        for step in np.diff([0.0, *(p["at_mm"] for p in path["points"])])
    ]
    assert SHORTEST_MS / 2e3 * SPEED - 1e-3 <= min(pieces) < SHORTEST_MS / 1e3 * SPEED


def test_play_is_taken_up_only_where_little_is_open(shop: Path) -> None:
    asked = ("--path-tolerance", TOLERANCE)
    report = compensated(
        shop, "job.pdl", "asked", *asked, "--set", STOPS, model="model"
    )
    few, many = (
        sum(bool(p["points"]) and p["points"][0]["at_mm"] < 1.0 for p in lines_of(own))
        for own in (report, told(shop, "stops"))
    )
    assert few < many / 2
    (found,) = [
        d for d in report["diagnostics"] if d["code"] == "backlash-preload-skipped"
    ]
    assert "diagnose --path" in found["message"]
    codes = {d["code"] for d in told(shop, "stops")["diagnostics"]}
    assert "backlash-preload-skipped" not in codes


def with_reversals(
    shop: Path, *width: float, in_motion: str = ""
) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Compensate with stops and a model whose reversals say so of the joints.

    Returns:
        Lines of the report, and its findings by their codes.
    """
    model = load_model(shop / "model.json")
    if in_motion:
        model = load_model(shop / f"{in_motion}.json")
    replace(model, flank_widths=(width,) * 6).save(shop / "known.json")
    asked = ("--path-tolerance", TOLERANCE, "--set", STOPS)
    report = compensated(shop, "job.pdl", "reversed", *asked, model="known")
    said = {d["code"]: d["message"] for d in report["diagnostics"]}
    return lines_of(report), said


def test_reversals_that_say_sharp_gaps_let_play_be_taken_up(shop: Path) -> None:
    paths, said = with_reversals(shop, 1.0, 1.25)
    assert "backlash-preload-skipped" not in said
    assert "unverified in motion" in said["path-points"]
    stops = [p for p in paths if p["points"] and p["points"][0]["at_mm"] < 1.0]
    assert len(stops) > LINES / 2
    run = simulate_file(shop / "reversed.pdl", CELL, SEED, path=True,
                        reference=shop / "job.pdl")  # fmt: skip
    true = {m["visit"]: m["max_mm"] for m in json.loads(run.to_json())["path"]}
    plain = real(shop, "plain")
    mean = np.mean([true[path["visit"]] for path in paths])
    assert mean < 0.5 * np.mean([plain[path["visit"]]["max_mm"] for path in paths])


def test_elastic_flanks_are_corrected_at_their_width(shop: Path) -> None:
    paths, _ = with_reversals(shop, 2.5, 6.0, in_motion="confirmed")
    assert not [p for p in paths if p["points"] and p["points"][0]["at_mm"] < 1.0]
    scores = []
    for name in ("reversed", "plain"):
        run = simulate_file(shop / f"{name}.pdl", CELL, SEED, path=True,
                            gears="elastic", reference=shop / "job.pdl")  # fmt: skip
        true = {m["visit"]: m["p95_mm"] for m in json.loads(run.to_json())["path"]}
        scores.append(np.array([true[path["visit"]] for path in paths]))
    assert scores[0].mean() < 0.5 * scores[1].mean()
    assert (scores[0] < scores[1] + 0.05).all()


def test_the_virtual_arm_keeps_closer_to_its_arcs(shop: Path) -> None:
    sizes, most = {}, {}
    for name in ("plain", "points", "stops"):
        true, own = real(shop, name), lines_of(told(shop, name), "CIRCULAR")
        assert len(own) == 4  # an arc is two paths
        sizes[name] = np.array([true[path["visit"]]["p95_mm"] for path in own])
        most[name] = np.array([true[path["visit"]]["max_mm"] for path in own])
        predicted = np.array([path["max_mm"]["after"] for path in own])
        assert np.abs(most[name] - predicted).max() < 0.1
    assert (sizes["points"] < 0.55 * sizes["plain"]).all()
    assert (most["points"] < most["plain"]).all()
    assert (most["stops"] < 0.4 * most["plain"]).all()


def test_arcs_are_cut_at_the_points_on_their_ways_too(shop: Path) -> None:
    arcs = lines_of(told(shop, "points"), "CIRCULAR")
    for first, second in zip(arcs[::2], arcs[1::2], strict=True):
        assert first["line"] == second["line"]
        assert first["points"][-1]["at_mm"] == pytest.approx(first["length_mm"])
        for half in (first, second):
            at = [0.0, *(point["at_mm"] for point in half["points"])]
            assert (np.diff(at) >= SHORTEST_MS / 1e3 * SPEED - 1e-3).all()
            assert (
                half["inserted"] == len(half["points"])
                and not half["insertion_skipped"]
            )
    text = (shop / "points.pdl").read_text()
    assert text.count("inserted (via)") == 2 and text.count("CIRCULAR") > 6


def test_both_halves_of_an_arc_are_open_where_one_is(
    shop: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged: list[PathPrediction] = []
    monkeypatch.setattr(insertion_loop, "judge", lambda p: judged.append(p) or p)
    monkeypatch.setattr(split_selection, "_list_far", one_half_of_every_arc)
    compensated(shop, "job.pdl", "halves", "--path-tolerance", TOLERANCE)
    (now,) = judged
    via = np.flatnonzero(now.task.visits.motion.via)
    assert len(via) > 1 and {*via, *(via + 1)} == set(now.plan.open)
    for half in via.tolist():  # it gets points of its own where it leaves its path
        alone = now.plan.points.get(half, ()) in ((), (1.0,))
        assert not alone or now.sizes[half] <= now.task.aim


def one_half_of_every_arc(now: PathPrediction) -> set[int]:
    return {*(np.flatnonzero(now.task.visits.motion.via) + 1).tolist()}


def test_pieces_of_unknown_speed_are_as_long_as_the_fastest_needs(shop: Path) -> None:
    (shop / "unknown.pdl").write_text(job())
    cell = shop / "limit.toml"
    left = compensated(shop, "unknown.pdl", "left", "--path-tolerance", TOLERANCE)
    assert not any(path["inserted"] for path in left["path"])
    assert "linear_limit_mm_s" in (messages(left, "path-tolerance-exceeded"))[0]
    points = {}
    for limit in (SPEED, 20.0 * SPEED):
        cell.write_text(f"[motion]\nlinear_limit_mm_s = {limit}\n" + CELL.read_text())
        done("compensate", shop / "unknown.pdl", "--cell", cell, "--model",
             shop / "confirmed.json", "-o", shop / "limit.pdl", "--report",
             shop / "limit.json", "--path-tolerance", TOLERANCE)  # fmt: skip
        found = told(shop, "limit")
        assert f"as {limit:g} mm/s needs" in messages(found, "path-points")[0]
        points[limit] = [path["points"] for path in found["path"]]
    for limit, moves in points.items():
        least = limit * SHORTEST_MS / 1e3
        for own in moves:
            at = [0.0, *(point["at_mm"] for point in own)]
            assert (np.diff(at) >= least - 1e-3).all()
    slow, fast = (sum(map(len, points[limit])) for limit in points)
    assert slow > fast > 0


LARGEST = (
    r"the predicted path error of the move is 0\.\d{3} mm, \d+ mm from its start "
    r"\((joint \d 0\.\d{3} mm.*|no joint that changes .*)\): .+\. [A-Z].+"
)


def test_every_move_left_too_far_names_joints_and_a_remedy(shop: Path) -> None:
    (shop / "untimed.pdl").write_text(job())
    asked = ("--path-tolerance", TOLERANCE)
    few = compensated(
        shop, "job.pdl", "few", *asked, "--set", "compensation.max_inserted=1"
    )
    unknown = compensated(shop, "untimed.pdl", "slow", *asked)
    for report in (unknown, few):
        found = messages(report, "path-tolerance-exceeded")
        sizes = [path["max_mm"]["after"] for path in report["path"]]
        assert len(found) == sum(size > TOLERANCE for size in sizes) > 0
        assert all(re.fullmatch(LARGEST, text) for text in found), found


def messages(report: dict[str, Any], code: str) -> list[str]:
    """Return the messages of the findings with a code."""
    return [one["message"] for one in report["diagnostics"] if one["code"] == code]


def test_of_two_points_too_close_for_the_error_the_one_with_more_room_goes() -> None:
    plan = InsertionPlan(points={7: (0.2, 0.5, 0.6)})
    now = Mock(plan=plan)
    now.steep_pieces.return_value = [2]  # from 0.5 to 0.6
    found = insertion_loop.drop_where_steep(now)
    assert found.points == {7: (0.2, 0.5)} and found.shut == {7: {0.6}}
    assert plan.points == {7: (0.2, 0.5, 0.6)} and not plan.shut  # as it was
    now.steep_pieces.return_value = []
    assert insertion_loop.drop_where_steep(now) is plan


def test_a_path_with_points_is_foretold_to_go_evenly_between_them() -> None:
    way = np.linspace(0.0, 1.0, 101)
    off = np.zeros((101, 3))
    off[:, 1] = np.where(way < 0.5, 2e-4, -1e-4)
    moved = insertion_loop._move_between(way, off, [0.0, 0.8, 1.0], [0.4, 0.6])
    known = np.interp(way, [0, 0.4, 0.6, 0.8, 1], [0, 2e-4, -1e-4, 0, 0])
    assert moved[:, 1] == pytest.approx(known) and not moved[:, ::2].any()


def test_points_on_both_flanks_are_sought_at_once() -> None:
    """The error of a line turns around in its middle, as where a joint turns back."""
    way = np.linspace(0.0, 0.5, 501)
    off = np.zeros((501, 3))
    off[:, 1] = np.where(way < 0.25, 1.0, -0.5) * 1e-3 * np.minimum(way, 0.5 - way)
    paths = Mock(way=way, tangent=np.tile([1.0, 0.0, 0.0], (501, 1)))
    paths.samples.return_value = slice(0, 501)
    paths.after.across = np.abs(off[:, 1])
    now = Mock(plan=InsertionPlan(open={7: (0.0025, 0.0025, 0.0025)}))
    now.path_to.return_value, now.task.aim = (paths, 0), 4e-5
    now.task.open_moves = frozenset()
    now.part_of.return_value.off_at_points = off
    found = insertion_loop._seek_on_path(now, 7)
    assert found == pytest.approx([0.498, 0.504], abs=0.002)
    now.task.open_moves = frozenset({7})
    assert insertion_loop._seek_on_path(now, 7) == found[:1]


@pytest.mark.parametrize(
    ("begins_off", "stays"),
    [({0: 0.3, 1: 0.06, 2: 0.05, 3: 0.07}, 2), ({0: 0.06, 1: 0.1, 2: 0.1, 3: 0.1}, 0)],
)
def test_a_move_keeps_the_stop_that_does_best_or_none(
    begins_off: dict[int, float], stays: int
) -> None:
    """Without a stop elastic joints may begin nearer than with any."""
    way, piece = np.linspace(0.0, 0.5, 1001), (2.5e-3, 2.5e-3, 2.5e-3)
    plan = InsertionPlan(open={7: piece}, idle={7: Mock()})
    task, places = Mock(aim=AIM * TOLERANCE * MM), (0.0, *TAKEN)
    paths = Mock(way=way)
    paths.samples.return_value = slice(0, len(way))
    here = [0]
    for _ in range(8):
        paths.after.across = np.full(len(way), begins_off[here[-1]] * MM)
        now = Mock(task=task, plan=plan, path_to=lambda v: (paths, 0))
        now.part_of.return_value.wanted = {(7, plan.points.get(7), None): []}
        plan = insertion_loop._put_on_path(now, plan, 7, 10)
        stop = plan.points[7][0] * way[-1] if 7 in plan.stops else 0.0
        here.append(int(np.argmin(np.abs(np.array(places) - stop))))
    assert here == [0, 1, 2, 3, *([stays] * 5)]
    assert plan.points == ({7: (places[stays] / way[-1],)} if stays else {})


def test_where_the_error_changes_fast_points_beside_it_are_taken_back(
    shop: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged: list[PathPrediction] = []
    usual = insertion_loop.judge
    monkeypatch.setattr(insertion_loop, "judge", lambda p: usual(judged.append(p) or p))
    strict = Path(CELL).read_text().replace("step_mm = 0.5", "step_mm = 0.1")
    (shop / "strict.toml").write_text(strict)
    done("compensate", shop / "job.pdl", "--cell", shop / "strict.toml", "--model",
         shop / "confirmed.json", "-o", shop / "strict.pdl", "--report",
         shop / "strict.json", "--path-tolerance", TOLERANCE)  # fmt: skip
    (plan,) = (now.plan for now in judged)
    assert len(plan.shut) > 2
    assert all(not gone & {*plan.points.get(v, ())} for v, gone in plan.shut.items())
    report = told(shop, "strict")
    assert all(target["status"] == "corrected" for target in report["targets"][2:])
    assert sum(path["inserted"] > 0 for path in report["path"]) > 5


def test_points_are_few_far_apart_and_told(shop: Path) -> None:
    report = told(shop, "points")
    for path in lines_of(report):
        at = [0.0, *(point["at_mm"] for point in path["points"]), path["length_mm"]]
        assert (np.diff(at) >= SHORTEST_MS / 1e3 * SPEED - 1e-3).all()
        assert path["inserted"] == len(path["points"]) <= 10
        assert path["max_mm"]["after"] <= path["without_mm"]
        if path["without_mm"] <= AIM * TOLERANCE:
            assert not path["points"]
        if path["max_mm"]["after"] > TOLERANCE:
            assert path["insertion_skipped"] or path["points"]
    assert sum(path["inserted"] for path in lines_of(report)) > 5
    findings = [d["code"] for d in report["diagnostics"]]
    assert "path-points" in findings and "path-tolerance-exceeded" in findings


def test_targets_are_those_of_the_source(shop: Path) -> None:
    plain, points = told(shop, "plain"), told(shop, "points")
    names = ("line", "visit", "move", "original", "status")
    for one, other in zip(plain["targets"], points["targets"], strict=True):
        assert [one.get(n) for n in names] == [other.get(n) for n in names]
    true = real(shop, "points")
    assert [p["line"] for p in points["path"]] == [p["line"] for p in plain["path"]]
    assert set(true) == set(real(shop, "plain"))


def test_all_bytes_come_back(shop: Path) -> None:
    done("restore", shop / "stops.pdl", "-o", shop / "back.pdl")
    assert (shop / "back.pdl").read_bytes() == (shop / "job.pdl").read_bytes()
    again = cli("compensate", shop / "stops.pdl", "--cell", CELL, "--model",
                shop / "model.json", "-o", shop / "twice.pdl")  # fmt: skip
    assert again.exit_code == 2 and "compensated already" in again.stderr


def test_diff_tells_points_apart(shop: Path) -> None:
    shown = cli("diff", shop / "job.pdl", shop / "stops.pdl").stdout.splitlines()
    points = [line for line in shown if "postproc: inserted" in line]
    count = sum(path["inserted"] for path in told(shop, "stops")["path"])
    assert len(points) == count and all("+ " in line for line in points)
    plain = cli("diff", shop / "job.pdl", shop / "plain.pdl").stdout.splitlines()
    assert len(shown) == len(plain) + count


def test_a_budget_holds(shop: Path) -> None:
    report = compensated(shop, "job.pdl", "few", "--path-tolerance", TOLERANCE,
                         "--set", "compensation.max_inserted=2",
                         "--report", shop / "few.html")  # fmt: skip
    assert (shop / "few.html").stat().st_size > 10_000
    assert sum(path["inserted"] for path in report["path"]) <= 2
    assert any("max_inserted" in d["message"] for d in report["diagnostics"])
    none = compensated(shop, "job.pdl", "none", "--path-tolerance", TOLERANCE,
                       "--set", "compensation.max_inserted=0")  # fmt: skip
    assert sum(path["inserted"] for path in none["path"]) == 0
    same = [(shop / f"{n}.pdl").read_bytes() for n in ("plain", "none")]
    assert same[0] == same[1]


def test_where_events_may_count_segments_nothing_is_split(shop: Path) -> None:
    handler = ("CONDITION[1] :", "  WHEN TIME 100 BEFORE END DO", "    $DOUT[1] := ON",
               "ENDCONDITION")  # fmt: skip
    lines = timed().split("\r\n")
    text = "\r\n".join([*lines[:2], *handler, *lines[2:]])
    (shop / "events.pdl").write_bytes(text.encode())
    report = compensated(shop, "events.pdl", "event", "--path-tolerance", TOLERANCE)
    assert sum(path["inserted"] for path in report["path"]) == 0
    assert any("events along a move" in d["message"] for d in report["diagnostics"])


# Targets that are approached anew.


def holes(speed: str = "  $LIN_SPD := 0.05\n") -> bytes:
    """Places that are reached from 0.4 mm above: within the plays of some joints."""
    return approaches({}).replace(b"BEGIN\n", f"BEGIN\n{speed}".encode())


@pytest.fixture(scope="module")
def drilled(shop: Path) -> Path:
    (shop / "holes.pdl").write_bytes(holes())
    for name, more in (
        ("once", ()),
        (
            "anew",
            (
                "--set",
                AGAIN,
            ),
        ),
    ):
        compensated(shop, "holes.pdl", name, *more)
        done("simulate", shop / f"{name}.pdl", "--cell", CELL, *ARM,
             "--reference", shop / "holes.pdl", "--path",
             "--report", shop / f"{name}.true.json")  # fmt: skip
    return shop


def landing(folder: Path, name: str) -> Floats:
    """How far the virtual arm lands from every target, (n,) [mm]."""
    cell = load_cell(CELL)
    setup, own = setup_of(cell), (_read(folder / f"{n}.pdl", cell) for n in
                                  ("holes", name))  # fmt: skip
    (wanted, _, _), (ran, rows, _) = own
    arm = virtual_arm(SEED, DEFAULT, coupling=setup.coupling, rows=1, tool=setup.tool)
    found = land(arm, setup, wanted, ran, rows)
    assert len(found.visit) == len(wanted)
    return np.linalg.norm(found.error, axis=1) / MM


def test_the_virtual_arm_lands_nearer_where_it_comes_anew(drilled: Path) -> None:
    report = told(drilled, "anew")
    moves = [p for p in report["path"] if p["inserted"]]
    rows = [p["visit"] for p in moves]
    assert len(rows) >= 10
    once, anew = landing(drilled, "once"), landing(drilled, "anew")
    assert anew[rows].mean() < 0.75 * once[rows].mean()
    worst = [np.quantile(size[rows], 0.9) for size in (once, anew)]
    assert worst[1] < 0.55 * worst[0]
    assert anew[rows].max() < 0.7 * once[rows].max()
    others = np.setdiff1d(np.arange(len(once)), rows)
    assert (anew[others] < once[others] + 0.01).all()
    codes = [[d["code"] for d in told(drilled, name)["diagnostics"]]
             for name in ("once", "anew")]  # fmt: skip
    assert "reapproach-inserted" in codes[1] and "reapproach-inserted" not in codes[0]
    assert told(drilled, "anew.true")["path_accuracy"]["max_mm"] < 1.0


def test_a_stop_to_come_from_is_near_and_behind(drilled: Path) -> None:
    report, most = told(drilled, "anew"), load_cell(CELL).limits.reapproach_mm
    lines = (drilled / "anew.pdl").read_text().splitlines()
    rows = [k for k, line in enumerate(lines) if line.endswith("(approach)")]
    assert len(rows) == sum(p["inserted"] for p in report["path"])
    assert all(p["points"][0]["approach"] for p in report["path"] if p["inserted"])
    for k in rows:
        above, stop, target = (
            np.array([float(x) for x in lines[k + i].split("POS(")[1].split(",")[:3]])
            for i in (-1, 0, 1)
        )
        assert 1.0 < np.linalg.norm(stop - target) < most + 1.0
        away = (stop - target) @ (target - above) / np.linalg.norm(target - above)
        assert away < 1.0  # beyond by no more than corrections differ
        assert lines[k].split()[:3] == ["MOVE", "LINEAR", "TO"]


def test_what_was_approached_anew_comes_back(drilled: Path) -> None:
    done("restore", drilled / "anew.pdl", "-o", drilled / "back.pdl")
    assert (drilled / "back.pdl").read_bytes() == holes()
    plain, anew = told(drilled, "once"), told(drilled, "anew")
    assert [t["line"] for t in plain["targets"]] == [t["line"] for t in anew["targets"]]


@pytest.mark.parametrize("between", ["$DOUT[2] := TRUE", "weld_on"])
def test_nothing_is_approached_anew_where_a_process_may_run(
    shop: Path, between: str
) -> None:
    text = holes().replace(b"  MOVE LINEAR", f"  {between}\n  MOVE LINEAR".encode())
    (shop / "process.pdl").write_bytes(text)
    report = compensated(shop, "process.pdl", "processed", "--set", AGAIN)
    assert sum(path["inserted"] for path in report["path"]) == 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--path-tolerance", 0.0), "greater than 0"),
        (("--set", STOPS), "--path-tolerance"),
        (("--path-mm", 0.1), "--path-mm is called --path-tolerance"),
        (("--take-up",), f"--take-up is called --set {STOPS}"),
    ],
)
def test_options_that_do_not_fit(
    shop: Path, options: tuple[object, ...], said: str
) -> None:
    found = cli("compensate", shop / "job.pdl", "--cell", CELL, "--model",
                shop / "model.json", "-o", shop / "no.pdl", *options)  # fmt: skip
    assert found.exit_code == 2 and said in found.stderr
    assert not (shop / "no.pdl").exists()


@pytest.mark.parametrize("change", ["moved", "taken out", "put in twice"])
def test_check_tells_a_point_that_was_touched(
    shop: Path, tmp_path: Path, change: str
) -> None:
    for name in ("points.pdl", "points.pdl.postproc.json"):
        (tmp_path / name).write_bytes((shop / name).read_bytes())
    given = (
        "check",
        tmp_path,
        "--model",
        shop / "confirmed.json",
        "--allow-uncorrected",
    )
    assert cli(*given).exit_code == 0
    place = tmp_path / "points.pdl"
    lines = place.read_bytes().split(b"\r\n")
    row = next(
        k for k, line in enumerate(lines) if line.endswith(b"postproc: inserted")
    )
    if change == "moved":
        lines[row] = lines[row].replace(b"POS(", b"POS(1", 1)
    elif change == "taken out":
        del lines[row]
    else:
        lines.insert(row, lines[row])
    place.write_bytes(b"\r\n".join(lines))
    found = cli(*given)
    assert found.exit_code == 1
    assert "points.pdl" in found.stdout + found.stderr


# Short ways, and turns in place.


@cache
def short() -> bytes:
    """Turn the tool in place, go on by millimetres, and away."""
    moves, rng = [], np.random.default_rng(7)
    for begin, _ in [m for m in drawn() if "LINEAR" in m[1]][:12]:
        numbers = [float(x) for x in re.findall(r"-?\d+\.\d+", begin)]
        place, turn = np.array(numbers[:3]), np.array(numbers[3:])
        there = np.add(turn, (0.0, 0.0, 20.0))
        moves += [begin, f"  MOVE LINEAR TO {pos(place, there)}"]
        for _ in range(4):
            place = place + rng.normal(size=3)
            moves.append(f"  MOVE LINEAR TO {pos(place, there)}")
        away = place + rng.uniform(-150, 150, 3)
        moves.append(f"  MOVE LINEAR TO {pos(away, turn)}")
    head = ["PROGRAM job", "BEGIN", *START, "  $LIN_SPD := 0.05"]
    return "\r\n".join([*head, *moves, "END job", ""]).encode()


@pytest.fixture(scope="module")
def turned(shop: Path) -> Path:
    (shop / "short.pdl").write_bytes(short())
    asked = ("--path-tolerance", TOLERANCE, "--set", STOPS)
    for name, more in (
        ("alone", ()),
        ("put", asked),
        ("both", (*asked, "--set", AGAIN)),
    ):
        compensated(shop, "short.pdl", f"short.{name}", *more)
    return shop


def test_every_way_ends_where_the_target_is_corrected(turned: Path) -> None:
    report = told(turned, "short.alone")
    side = [np.abs(target["side"]).min() for target in report["targets"]]
    ends = [
        path["curve"]["after_mm"][-1]
        for path in report["path"]
        if path.get("curve") and side[path["visit"]] > 0.999
    ]
    assert len(ends) > 30 and np.quantile(ends, 0.95) < 0.001 and max(ends) < 0.005


def test_no_stop_lies_beyond_the_target(turned: Path) -> None:
    for name in ("put", "both"):
        paths = told(turned, f"short.{name}")["path"]
        assert sum(p["inserted"] for p in paths) > 10
        for path in paths:
            places = [0.0, *(p["at_mm"] for p in path["points"]), path["length_mm"]]
            assert (np.diff(places) > 0).all()
        done("restore", turned / f"short.{name}.pdl", "-o", turned / f"{name}.back")
        assert (turned / f"{name}.back").read_bytes() == short()


def test_targets_are_approached_anew_only_where_no_path_is_worse(drilled: Path) -> None:
    asked = ("--path-tolerance", TOLERANCE, "--set", STOPS, "--set", AGAIN)
    report = compensated(drilled, "holes.pdl", "holes.both", *asked)
    usual = {p["visit"]: p["max_mm"]["after"] for p in told(drilled, "once")["path"]}
    assert any(d["code"] == "reapproach-inserted" for d in report["diagnostics"])
    for path in report["path"]:
        most = max(usual[path["visit"]] + 0.05, TOLERANCE)
        assert path["max_mm"]["after"] <= most + 1e-6
        if "approached again" in (path["insertion_skipped"] or ""):
            assert path["inserted"]


def test_an_arc_that_loses_all_points_is_whole_again() -> None:
    plan = InsertionPlan(
        points={5: (1.0,), 6: (0.4,)}, chords=frozenset({(6, 1.0)})
    ).drop(6, {0.4})
    assert plan.points == {} and plan.chords == set()
    plan = InsertionPlan(points={5: (0.5, 1.0), 6: (0.4,)}).drop(6, {0.4})
    assert plan.points == {5: (0.5, 1.0)}


def test_points_behind_which_a_move_would_be_worse_are_taken_back() -> None:
    def sizes(*mm: float) -> dict[int, MoveDeviation]:
        pairs = zip([3, 4, 9], mm, strict=True)
        return {v: MoveDeviation(0.0, far * MM) for v, far in pairs}

    now = Mock(plan=InsertionPlan(points={3: (0.5,)}), cut_arcs=[])
    now.task.visits.motion.kind = [Motion.LINEAR] * 10
    without = sizes(0.3, 0.01, 0.01)
    now.deviations = sizes(0.02, 0.07, 0.09)
    ((v, (why, *_)),) = prune._harmful(now, without)  # 9 is too far behind
    assert v == 3 and "a later move would be worse" in why
    now.deviations = sizes(0.02, 0.05, 0.09)
    assert not [*prune._harmful(now, without)]


@pytest.mark.parametrize(
    ("far", "within", "goes"),
    [
        (0.129, 0.120, False),
        (0.138, 0.050, False),  # nearer by what 95 % of the way stays within
        (0.170, 0.000, True),  # a place farther by 0.041 mm is not made up for
        (0.120, 0.140, True),
    ],
)
def test_points_are_judged_by_all_of_a_way(
    far: float, within: float, goes: bool
) -> None:
    task = Mock(tolerance=TOLERANCE * MM)
    now = Mock(task=task, refusals={}, deviations={3: MoveDeviation(within * MM, 0.0)})
    without = {3: MoveDeviation(0.120 * MM, 0.129 * MM)}
    judged = prune._Judged(now, without, {3: (far * MM, 0.25)}, {}, set())
    removal = judged.why_not(3)
    assert (removal is not None) == goes
    assert removal is None or "no better" in removal.why


def test_a_rounded_point_is_judged_by_the_worst_of_all_its_zones() -> None:
    rng = np.random.default_rng(4)
    aside, half, done = np.linspace(0.0, 0.015, 7), 0.01, 0.25
    moved, tangent = 1e-4 * rng.normal(size=3), np.tile((1.0, 0.0, 0.0), (7, 1))
    off = 1e-4 * rng.normal(size=(7, 3))
    points = RoundedPoints(np.array([half]), moved[None], np.array([done]), np.zeros(1))
    found = points.farthest(np.zeros(7, dtype=int), aside, off, tangent)
    bend = np.maximum(1.0 - (aside / half) ** 2, 0.0)[:, None]
    tried = [off + u * bend * moved for u in np.linspace(-done, 1.0 - done, 21)]
    worst = np.max([np.hypot(one[:, 1], one[:, 2]) for one in tried], axis=0)
    np.testing.assert_allclose(found, np.where(aside <= half, worst, 0.0), atol=1e-12)
