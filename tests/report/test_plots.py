"""Plots for papers: the same comparison gives the same file."""

from __future__ import annotations

import pytest

from postproc.calibration.baselines import Comparison, MethodRow
from postproc.exceptions import OutputError
from postproc.report.plots import plot_comparison


def comparison():
    rows = (
        MethodRow("full", 0.01, 0.2, 0.05, 0.02, 100),
        MethodRow("elm", 0.2, 4.0, 1.4, 0.6, 100),
    )
    return Comparison(rows, "200 rows to fit, 100 to test", (40.0,) * 6)


@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_a_comparison_becomes_a_picture(suffix, tmp_path):
    first, second = (
        plot_comparison(comparison(), tmp_path / f"{name}{suffix}").read_bytes()
        for name in ("a", "b")
    )
    assert first == second
    begins = b"\x89PNG" if suffix == ".png" else b"<?xml"
    assert first.startswith(begins)
    assert b"<dc:date>" not in first


def test_other_formats_and_missing_folders_are_refused(tmp_path):
    wrong = {"a.xyz": r"\.png or \.svg", "none/a.png": "folder does not exist"}
    for place, why in wrong.items():
        with pytest.raises(OutputError, match=why):
            plot_comparison(comparison(), tmp_path / place)
