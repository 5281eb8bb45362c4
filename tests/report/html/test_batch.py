"""The page of a batch: what it counts, and that no name or finding is markup."""

from __future__ import annotations

from postproc.report.html import batch_report
from tests.report.html.test_program import NASTY, Elements

FIGURES = {"mean": 1.2, "std": 0.1, "p95": 1.4, "max": 1.5}
DONE = {
    "visits": 7,
    "corrected": 6,
    "uncorrected": 0,
    "largest_mm": 1.625,
    "before_mm": FIGURES,
    "after_mm": {**FIGURES, "mean": 0.004},
    "expected_mm": {"before": 1.3, "after": 0.034, "below_95": 0.05, "worst_95": 0.07},
    "worst": "",
}
LEFT = {
    **DONE,
    "uncorrected": 2,
    "uncorrected_lines": ["a.pdl:3: rejected: too near"],
}


def page(*entries):
    return batch_report("src -> dst", entries)


def texts(html):
    """Return the texts of the cells of every program, by its name."""
    body = html.split("<tbody>")[1].split("</tbody>")[0]
    return {row.split("</th>")[0].split(">")[-1]: row for row in body.split("<tr ")[1:]}


def test_programs_are_listed_with_their_figures_the_absent_first():
    html = page(
        ("b/done.pdl", "done", DONE),
        ("a/left.pdl", "uncorrected", LEFT),
        ("z/bad.pdl", "failed", {"error": "is no program text"}),
        ("notes.txt", "copied", {}),
        ("old.pdl", "removed", {}),
    )
    rows = texts(html)
    assert list(rows) == ["z/bad.pdl", "a/left.pdl", "b/done.pdl"]
    assert "is no program text" in rows["z/bad.pdl"] and "–" in rows["z/bad.pdl"]
    assert "a.pdl:3: rejected: too near" in rows["a/left.pdl"]
    assert "1.625" in rows["b/done.pdl"] and "1.300 → 0.034" in rows["b/done.pdl"]
    assert '<span class="value">3</span><span class="note">2 compensated' in html


def test_names_and_findings_are_never_markup():
    plain = Elements(page(("a.pdl", "uncorrected", LEFT)))
    nasty = {**LEFT, "uncorrected_lines": [NASTY], "findings": []}
    html = page((NASTY, "uncorrected", nasty))
    found = Elements(html)
    assert found.tags == plain.tags
    assert not found.fetched
    assert "\x1b" not in html and "\u202e" not in html


def test_a_torn_or_foreign_log_makes_a_page_too():
    html = page(("a.pdl", "done", {"visits": "many", "before_mm": 3, "largest_mm": []}))
    assert "a.pdl" in texts(html)
    assert not Elements(page()).fetched
