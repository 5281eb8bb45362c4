from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from postproc.exceptions import OutputError, ProgramError
from postproc.report.html import (
    calibration_report,
    comparison_report,
    diagnosis_report,
    report_file,
)
from postproc.report.html.diagnosis import distinct, running_mean
from postproc.report.html.figure import (
    distribution,
    in_space,
    magnification,
    pose_figures,
)
from postproc.report.html.model import list_correlated, steps
from postproc.report.json import report_text
from tests.report.html.builders import outcome_of, program_text
from tests.report.html.test_program import NASTY, Elements


def model_file(name: str = "geometry.a1") -> dict[str, Any]:
    """Write a model of two parameters that the rows hardly tell apart."""
    parameters = [
        {
            "name": name,
            "unit": "m",
            "value": 1e-3,
            "std_error": 1e-5,
            "prior_std": 1e-3,
        },
        {
            "name": "backlash.b1",
            "unit": "rad",
            "value": 1e-4,
            "std_error": 9.9e-4,
            "prior_std": 1e-3,
        },
    ]
    return {
        "format": 1,
        "id": "abc",
        "parent": None,
        "method": "full",
        "arm": {"name": "nj", "id": "1"},
        "data_sha256": "0" * 64,
        "rows": 60,
        "effects": [{"name": "geometry", "settings": {}}],
        "parameters": parameters,
        "covariance": [1e-10, 0.95e-5 * 9.9e-4, 9.9e-4**2],
        "spread": [0, 0, 0],
        "noise": {"tracker": 1.0, "joint": 1e-6, "origin": None},
        "ranges": {"lower": [-1] * 6, "upper": [1] * 6, "tools": [[0, 0, 0]]},
        "statistics": {"residual_mean_mm": 0.02},
        "history": [{"effect": NASTY}],
    }


def fit_of(n: int = 60) -> dict[str, Any]:
    """Write the evidence of a fit: every pose from both sides."""
    rng = np.random.default_rng(3)
    q = np.repeat(rng.uniform(-90, 90, (n // 2, 6)), 2, axis=0)
    side = np.tile([[1] * 6, [-1] * 6], (n // 2, 1))
    before = rng.normal(0.0, 0.5, (n, 3)) + side[:, :3] * 0.1
    spread = {"mean_mm": 0.9, "std_mm": 0.3, "p95_mm": 1.4, "max_mm": 2.0, "n": n}
    return {
        "shares": {"geometry": 0.9},
        "dropped": [{"id": NASTY, "line": 7, "why": "dropped: off by 3 mm"}],
        "unseen": ["geometry.d2 with geometry.d3"],
        "warnings": [NASTY],
        "before": spread,
        "after": {k: v / 20 for k, v in spread.items()},
        "tracker_mm": 0.011,
        "repeatability_mm": 0.02,
        "effective": 1.4,
        "rows": {
            "id": [str(i) for i in range(n)],
            "q_deg": q.tolist(),
            "lambda": side.tolist(),
            "position_mm": rng.uniform(-900, 900, (n, 3)).tolist(),
            "before_mm": before.tolist(),
            "after_mm": (before / 20).tolist(),
        },
    }


def diagnosis() -> dict[str, Any]:
    """Write a diagnosis that found one effect, with all that the page can show."""
    x = np.linspace(-90, 90, 80)
    before = {"mean_mm": 0.09, "std_mm": 0.04, "p95_mm": 0.16, "max_mm": 0.22}
    effect = {
        "effect": "transmission",
        "joint": 3,
        "source": "joint 3",
        "p_value": 1e-40,
        "share": 0.8,
        "peak_mm": 0.1,
        "parameters": {NASTY: [0.05, 0.002, "mrad"]},
        "confusable_with": [{"effect": "joint_map", "joint": 3}],
        "kept": True,
        "evidence": {
            "covariate": "joint 3",
            "unit": "deg",
            "direction": "joint 3",
            "x": x.tolist(),
            "before_mm": (0.1 * np.sin(np.radians(2 * x))).tolist(),
            "after_mm": (0 * x).tolist(),
        },
    }
    return {
        "verdict": "effect",
        "noise_floor_mm": 0.03,
        "n_fit": 200,
        "n_held_out": 100,
        "before": before,
        "after": {k: v / 3 for k, v in before.items()},
        "vap_mm": {"before": 0.05, "after": 0.03},
        "effects": [effect],
        "candidates": [
            {"effect": "lag", "joint": 1, "source": "speed", "p_value": 0.0}
        ],
        "rows": {
            "before_mm": np.full((20, 3), 0.05).tolist(),
            "after_mm": np.full((20, 3), 0.02).tolist(),
        },
        "next_measurements": [[0.0, 0.0, -90.0, 0.0, 60.0, 0.0]],
        "history": [{"effect": "transmission", "parent": "abc"}],
    }


def comparison() -> dict[str, Any]:
    """Write a comparison of two methods."""
    row = {"min_mm": 0.1, "max_mm": 1.5, "mean_mm": 0.8, "std_mm": 0.3, "n": 150}
    better = {"min_mm": 0.01, "max_mm": 0.3, "mean_mm": 0.1, "std_mm": 0.05, "n": 150}
    rows = [{"method": "none", **row}, {"method": NASTY, **better}]
    split, span = "300 rows to fit, 150 to test", [347.2, 159.0, 252.4, 344, 239, 40.0]
    return {"rows": rows, "split": split, "span_deg": span}


def noise() -> dict[str, Any]:
    """Write the shortest diagnosis that there is."""
    return diagnosis() | {
        "verdict": "noise",
        "vap_mm": None,
        "effects": [],
        "candidates": [],
        "rows": None,
        "next_measurements": [],
        "history": [],
    }


PAGES = {
    "model": lambda: calibration_report(model_file(NASTY)),
    "fit": lambda: calibration_report(model_file(), fit_of()),
    "effect": lambda: diagnosis_report(diagnosis()),
    "noise": lambda: diagnosis_report(noise()),
    "comparison": lambda: comparison_report(comparison()),
}


@pytest.mark.parametrize("name", PAGES)
def test_pages_are_whole_and_inert(name: str) -> None:
    text = PAGES[name]()
    page = Elements(text)
    assert page.fetched == []
    assert page.tags.count("script") == 6  # data, settings, plotly, three of ours
    assert not set("\x00\x1b\u202e") & set(text)
    drawn = set(page.payload()["figures"])
    wanted = {part.split('"')[0] for part in text.split('data-figure="')[1:]}
    assert wanted == drawn


def test_the_model_page_says_what_it_does_not_know() -> None:
    text = calibration_report(model_file())
    assert "backlash.b1</li>" in text  # its standard error is that of its prior
    assert "geometry.a1</li>" not in text
    assert "carries no rows" in text


def test_a_model_may_carry_its_fit() -> None:
    told = calibration_report(model_file() | {"fit": fit_of()})
    assert told == calibration_report(model_file() | {"fit": fit_of()}, fit_of())
    assert "carries no rows" not in told and "0.900 → 0.045 mm" in told


def test_correlations_come_from_the_packed_covariance() -> None:
    ((a, b, r),) = list_correlated(model_file())
    assert (a, b) == ("geometry.a1", "backlash.b1")
    assert r == pytest.approx(0.95)


def test_evidence_is_told_in_words_too() -> None:
    text = diagnosis_report(diagnosis())
    assert "transmission of joint 3<" in text
    assert "joint_map of joint 3" in text
    assert "no missing effect" in diagnosis_report(noise())
    told = "3 readings of 1 monuments: <the tracker did not move"
    seen = {"monuments": [told], "undetectable": ["waves & more"]}
    page = diagnosis_report(noise() | seen)
    assert told.replace("<", "&lt;") in page and "waves &amp; more" in page
    assert "Not excluded" in page and "Not excluded" not in text


def test_candidates_of_one_name_are_told_once() -> None:
    wave = {"effect": "transmission", "joint": 3, "source": "joint 3"}
    given = [{**wave, "p_value": p} for p in (0.5, 1e-9)]
    lag = {"effect": "lag", "joint": 1, "source": "speed", "p_value": 0.1}
    assert [c["p_value"] for c in distinct([*given, lag])] == [1e-9, 0.1]


def test_the_history_is_told_in_rows() -> None:
    added = {"effect": "coupling", "joint": 6, "source": "joint 5", "p_value": 0.0}
    told = {"parent": "abc", "verdict": "effect", "added": [added], "n_held_out": 80,
            "before": {"mean_mm": 0.4}, "after": {"mean_mm": 0.1}}  # fmt: skip
    (row,) = steps([told])
    assert row["added"] == ["coupling of joint 6 by joint 5"]
    assert (row["before"], row["after"], row["rows"]) == (0.4, 0.1, 80)
    page = calibration_report(model_file() | {"history": [told, {}]})
    assert "coupling of joint 6 by joint 5" in page and "&#39;mean_mm" not in page
    assert steps(None) == []


def test_a_comparison_tells_how_far_the_joints_span() -> None:
    told = "Joints 1 to 6 span 347, 159, 252, 344, 239, 40 deg"
    assert told in comparison_report(comparison())
    old = {k: v for k, v in comparison().items() if k != "span_deg"}
    assert (
        "span" not in comparison_report(old).partition("<main")[0].partition("<h1")[2]
    )


def test_running_means_follow_a_line() -> None:
    x = np.random.default_rng(1).permutation(np.linspace(0.0, 1.0, 240))
    middle, mean = running_mean(x, 3 * x)
    np.testing.assert_allclose(mean, 3 * np.array(middle), atol=1e-5)
    assert len(middle) == 24


def test_a_distribution_counts_every_row() -> None:
    rng = np.random.default_rng(2)
    sizes = {"before": rng.uniform(0.1, 3, 500), "after": rng.uniform(0.001, 0.1, 400)}
    before, after = distribution(sizes)["traces"]
    assert sum(before["y"]) == 500 and sum(after["y"]) == 400


def test_lines_in_space_start_at_the_rows() -> None:
    p = np.array([[0.0, 0, 0], [1000, 0, 0]])
    e = np.array([[0.0, 0, 1], [0, 0.5, 0]])
    (trace,) = in_space(p, {"before": e})["traces"]
    assert trace["x"] == [0.0, 0.0, None, 1000.0, 1000.0, None]
    assert trace["name"] == "before, drawn 50 times as long"
    assert trace["z"][1] == 50.0 and trace["y"][4] == 25.0


@pytest.mark.parametrize(
    ("wanted", "got"), [(0.0, 1.0), (1.0, 1.0), (19.9, 10.0), (50.0, 50.0), (999, 500)]
)
def test_magnifications_are_round(wanted: float, got: float) -> None:
    assert magnification(wanted) == got


def test_iso_figures_by_their_definition() -> None:
    q = np.zeros((4, 6))
    side = np.array([[1] * 6, [1] * 6, [-1] * 6, [-1] * 6])
    error = np.array([[1.0, 0, 0], [3, 0, 0], [0, 4, 0], [0, 4, 0]])
    found = pose_figures(q, side, error)
    # Landings from +: mean (2, 0, 0), both 1 away from it; from -: both at (0, 4, 0).
    assert found.accuracy == pytest.approx((3.0, 4.0))
    assert found.repeatability == pytest.approx((0.5, 1.0))
    assert found.variation == pytest.approx((np.sqrt(20), np.sqrt(20)))
    assert (found.repeated, found.several, found.arrivals) == (2, 1, 2)


def test_figures_of_a_few_arrivals_are_no_iso_values() -> None:
    one, two = (
        pose_figures(np.zeros((n, 6)), np.ones((n, 6), dtype=int), np.ones((n, 3)))
        for n in (29, 30)
    )
    assert one.remarks["repeatability"] == "not an ISO value: 29 of 30 cycles"
    assert set(two.remarks.values()) == {""}


def test_iso_figures_need_repetition() -> None:
    found = pose_figures(np.eye(6), np.ones((6, 6), dtype=int), np.ones((6, 3)))
    assert np.isnan([*found.accuracy, *found.variation]).all()
    assert found.repeated == found.several == 0


@pytest.mark.parametrize(
    ("data", "title"),
    [
        (model_file(), "Calibration of nj"),
        (diagnosis(), "Diagnosis: effect"),
        (comparison(), "Methods compared"),
        (json.loads(report_text(outcome_of(20))), "panel.pdl"),
    ],
    ids=["model", "diagnosis", "comparison", "program"],
)
def test_the_file_tells_which_page_it_wants(
    data: dict[str, Any], title: str, tmp_path: Path
) -> None:
    place = tmp_path / "in.json"
    place.write_text(json.dumps(data))
    report_file(place, tmp_path / "out.html")
    assert f"<h1>{title}" in (tmp_path / "out.html").read_text(encoding="utf-8")


def test_source_lines_are_found_beside_the_report(tmp_path: Path) -> None:
    (tmp_path / "panel.pdl").write_bytes(program_text(20))
    (tmp_path / "in.json").write_text(report_text(outcome_of(20)))
    report_file(tmp_path / "in.json", tmp_path / "out.html")
    text = (tmp_path / "out.html").read_text(encoding="utf-8")
    assert Elements(text).payload()["listing"]["panel.pdl"]["line"] == [1, 24]


@pytest.mark.parametrize("text", ["", "[1]", "{}", '{"targets": [{}]}', '{"rows": 1}'])
def test_other_files_are_refused(text: str, tmp_path: Path) -> None:
    place = tmp_path / "in.json"
    place.write_text(text)
    with pytest.raises(ProgramError, match=r"in\.json"):
        report_file(place, tmp_path / "out.html")
    assert not (tmp_path / "out.html").exists()


def test_a_missing_file_or_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match="cannot be read"):
        report_file(tmp_path / "no.json", tmp_path / "out.html")
    (tmp_path / "in.json").write_text(json.dumps(comparison()))
    with pytest.raises(OutputError, match="folder does not exist"):
        report_file(tmp_path / "in.json", tmp_path / "no" / "out.html")
