from __future__ import annotations

import base64
import gzip
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.language.visits import Meaning
from postproc.report.html import program, program_report, program_report_from_json
from postproc.report.html.program import (
    columns_from,
    columns_of,
    group_uncorrected,
    histogram,
    listing,
    stretches,
)
from postproc.report.json import report_text
from postproc.verify.opinion import Opinion, OpinionRow
from tests.language.neutral_job import drawn, rapid
from tests.report.html.builders import FIRST_LINE, outcome_of
from tests.written import FIRST, POSE
from tests.written import program as written

NASTY = '<script>alert("x")</script>\'\x1b[31m\u202e'


class Elements(HTMLParser):
    """The elements of a page, its scripts' data, and what it would fetch."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.fetched: list[str] = []
        self.texts: list[str] = []
        self.data = self.kind = ""
        self.inside = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        given = dict(attrs)
        links = [given[k] or "" for k in ("src", "href", "action") if k in given]
        self.fetched += [v for v in links if not v.startswith(("data:", "#"))]
        self.inside = tag
        if given.get("id") == "data":
            self.inside, self.kind = "data", given["type"] or ""

    def handle_endtag(self, tag: str) -> None:
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside == "data":
            self.data += data
        elif self.inside not in ("script", "style"):
            self.texts.append(data)

    def payload(self) -> dict[str, Any]:
        text: str | bytes = self.data
        if self.kind == "application/gzip":
            text = gzip.decompress(base64.b64decode(self.data))
        loaded: dict[str, Any] = json.loads(text)
        return loaded


def test_the_page_needs_nothing_else() -> None:
    page = Elements(program_report(outcome_of()))
    assert page.fetched == []
    assert page.tags.count("script") == 11  # data, settings, plotly, eight of ours
    assert not {"iframe", "object", "embed", "img", "form", "base"} & set(page.tags)


def test_names_stay_text() -> None:
    outcome = outcome_of(name=f"{NASTY}.pdl", names=("", NASTY), extra=NASTY)
    text = program_report(outcome)
    page = Elements(text)
    assert page.tags.count("script") == 11
    assert "<script>alert(" not in text
    assert not set("\x00\x1b\u202e\u2028") & set(text)
    shown = '<script>alert("x")</script>\'\\x1b[31m\\u202e'
    assert any(shown in told for told in page.texts)
    payload = page.payload()
    assert payload["columns"]["names"] == ["", shown]
    lines = payload["listing"][f"{shown}.pdl"]["text"]
    assert "<script>alert(" in lines[1] and "\\x1b[31m" in lines[1]


def test_the_file_name_is_the_key_that_the_page_looks_up() -> None:
    payload = Elements(program_report(outcome_of(name=f"a{NASTY}"))).payload()
    assert set(payload["listing"]) == set(payload["columns"]["files"])


def test_left_alone_comes_first_and_in_words() -> None:
    outcome = outcome_of(200)
    text = program_report(outcome)
    assert text.index('id="left"') < text.index('id="bench"') < text.index("Time</h2>")
    groups = group_uncorrected(columns_of(outcome))
    assert [g.status for g in groups] == ["conflict", "rejected", "runtime"]
    assert [g.count for g in groups] == [5, 5, 5]
    assert groups[0].examples[0] == (4, "panel.pdl", FIRST_LINE + 3, "")
    for group in groups:
        assert group.why in text.replace("&#39;", "'")


def test_nothing_left_alone_is_said() -> None:
    outcome = outcome_of(3)
    assert not group_uncorrected(columns_of(outcome))
    assert "Every target of the program was corrected" in program_report(outcome)


def test_a_written_report_gives_the_same_columns() -> None:
    outcome = outcome_of(90, names=("", "p1", "p2"))
    a = columns_of(outcome)
    b = columns_from(json.loads(report_text(outcome))["targets"])
    for key in ("visit", "line", "literal_line", "move", "status", "direction"):
        np.testing.assert_array_equal(getattr(a, key), getattr(b, key))
    for key in ("q_deg", "original", "corrected", "position_mm", "correction_mm"):
        np.testing.assert_allclose(getattr(a, key), getattr(b, key), atol=1e-4)
    for index, texts in (("file", "files"), ("name", "names"), ("why", "reasons")):
        told_a = [getattr(a, texts)[k] for k in getattr(a, index)]
        assert told_a == [getattr(b, texts)[k] for k in getattr(b, index)]


def test_a_written_report_makes_a_page() -> None:
    outcome = outcome_of(40)
    data = json.loads(report_text(outcome))
    page = Elements(program_report_from_json(data, outcome.sources)).payload()
    assert page["listing"]["panel.pdl"]["line"] == [1, 44]
    bare = Elements(program_report_from_json(data)).payload()
    assert bare["listing"] == {}


def test_a_report_says_which_effect_has_which_share() -> None:
    data = json.loads(report_text(outcome_of(3)))
    assert program.shares_from(data["targets"]).effects == ()
    told = [{"geometry": 0.5, "backlash": 0.125}, {"geometry": 0.25}, None]
    for target, shares in zip(data["targets"], told, strict=True):
        target["share_mm"] = shares
    columns = Elements(program_report_from_json(data)).payload()["columns"]
    assert columns["effects"] == ["geometry", "backlash"]
    assert columns["numbers"]["share_mm"]["values"] == [
        5000, 1250, 2500, None, None, None,
    ]  # fmt: skip


def test_an_outcome_says_which_effect_has_which_share(job_cell, job_model) -> None:
    outcome = compensate(written(FIRST, POSE), job_cell, job_model, name="job.pdl")
    direct = program.shares_of(outcome)
    data = json.loads(report_text(outcome))
    again = program.shares_from(data["targets"])
    assert direct.effects == again.effects and "geometry" in direct.effects
    np.testing.assert_allclose(direct.size_mm, again.size_mm, atol=1e-5)
    pages = [program_report(outcome), program_report_from_json(data, outcome.sources)]
    a, b = (Elements(page).payload()["columns"]["numbers"] for page in pages)
    assert a["share_mm"] == b["share_mm"]


def test_a_page_has_what_free_forms_predict(job_cell, job_model, free_model) -> None:
    for model, width in ((job_model, 0), (free_model, 3)):
        outcome = compensate(written(FIRST, POSE), job_cell, model, name="job.pdl")
        direct = program.shares_of(outcome)
        again = program.shares_from(json.loads(report_text(outcome))["targets"])
        for key in ("free_mm", "free_std_mm"):
            assert getattr(direct, key).shape == (2, width)
            np.testing.assert_allclose(
                getattr(direct, key), getattr(again, key), atol=1e-5
            )


def test_a_report_without_positions_has_no_view() -> None:
    data = json.loads(report_text(outcome_of(20)))
    for target in data["targets"]:
        del target["position_mm"]
    text = program_report_from_json(data)
    assert 'id="view"' not in text and "does not say where the targets lie" in text


def test_an_empty_program_makes_a_page() -> None:
    outcome = outcome_of(0)
    assert "No target could be corrected" in program_report(outcome)


def test_numbers_survive_packing() -> None:
    columns = columns_of(outcome_of(50))
    size = np.random.default_rng(2).uniform(0.0, 1.0, (50, 3))
    free, std = size - 0.5, size / 3
    shares = program.PageShares(("a", "b", NASTY), size, free, std)
    packed = program.pack(columns, shares)
    for key in ("position_mm", "correction_mm", "std_mm", "q_deg", "original"):
        step = packed["numbers"][key]["step"]
        values = np.array(packed["numbers"][key]["values"], dtype=float) * step
        wanted = getattr(columns, key).ravel()
        np.testing.assert_allclose(values, wanted, atol=0.5001 * step)
    assert len(packed["effects"]) == 3
    for key, given in (
        ("share_mm", size),
        ("nonparametric_mm", free),
        ("nonparametric_std_mm", std),
    ):
        told = packed["numbers"][key]
        assert told["width"] == 3
        values = np.array(told["values"]).reshape(50, 3) * told["step"]
        np.testing.assert_allclose(values, given, atol=0.5001 * told["step"])
    sides = np.array([{"-": -1, "0": 0, "+": 1}[s] for s in packed["direction"]])
    np.testing.assert_array_equal(sides.reshape(-1, 6), columns.direction)


def test_the_histogram_counts_every_correction() -> None:
    columns = columns_of(outcome_of(400))
    counted = histogram(columns)
    assert sum(counted["counts"]) == (columns.status == Status.CORRECTED).sum()
    assert counted["edges_mm"][-1] == pytest.approx(columns.size_mm.max(), abs=1e-6)


def test_a_page_of_a_huge_program_keeps_what_matters() -> None:
    columns = columns_of(outcome_of(5000))
    rows = program.choose(columns, most=1000)
    assert len(rows) == 1000 and (np.diff(rows) > 0).all()
    left = np.isin(columns.status, (Status.CONFLICT, Status.REJECTED, Status.RUNTIME))
    assert np.isin(np.flatnonzero(left), rows).all()
    assert int(np.argmax(columns.size_mm)) in rows
    gaps = np.diff(rows)
    assert gaps.max() < 30  # the others evenly: no stretch of the path is missing


def test_too_many_left_alone_leave_room_for_others() -> None:
    columns = columns_of(outcome_of(5000))
    rows = program.choose(columns, most=200)
    assert len(rows) == 200
    assert (columns.status[rows] == Status.CORRECTED).sum() >= 80


def test_source_lines_are_those_of_the_file() -> None:
    data = b"one\rtwo\r\nthree\n\x1bfour"
    columns = columns_of(outcome_of(0))
    shown = listing({"a.pdl": data}, columns)["a.pdl"]
    assert shown == {"line": [1, 4], "text": ["one", "two", "three", "\\x1bfour"]}


def test_of_long_files_only_the_named_lines_are_carried(monkeypatch: Any) -> None:
    monkeypatch.setattr("postproc.report.html.program.WHOLE", 20)
    outcome = outcome_of(60)
    columns = columns_of(outcome)[np.array([0, 1, 7])]
    shown = listing(outcome.sources, columns)["panel.pdl"]
    assert shown["line"] == [FIRST_LINE, 2, FIRST_LINE + 7, 1]
    assert len(shown["text"]) == 3
    assert all("MOVEFLY" in str(text) for text in shown["text"])


def test_stretches_of_lines() -> None:
    assert stretches(np.array([], dtype=np.int64)) == []
    assert stretches(np.array([1])) == [1, 1]
    assert stretches(np.array([1, 3, 4])) == [1, 1, 3, 2]


def test_a_page_of_100_000_targets_stays_small() -> None:
    text = program_report(outcome_of(100_000))
    assert len(text.encode()) < 30e6
    assert re.search(r"<td class=\"number\">2500</td>", text)


def test_all_numbers_of_a_rapid_target_have_a_head(bench_cell, bench_model) -> None:
    source = rapid(drawn(bench_cell, 1, 8))
    outcome = compensate(source, bench_cell, bench_model, name="job.mod")
    written = json.loads(report_text(outcome))
    for page in (program_report(outcome), program_report_from_json(written)):
        packed = Elements(page).payload()["columns"]
        heads = "x y z q1 q2 q3 q4 cf1 cf4 cf6 cfx".split()
        assert packed["heads"] == heads
        numbers = packed["numbers"]["original"]
        assert numbers["width"] == len(heads)
        rows = np.array(numbers["values"], dtype=float).reshape(-1, len(heads))
        joints = outcome.visits.target.meaning == Meaning.JOINTS
        assert joints.any() and not joints.all()
        assert np.isnan(rows[joints, 6:]).all() and np.isfinite(rows[~joints]).all()


ROWS = (
    OpinionRow("output: place", "mm", 40, 0, 1e-9, 1e-3, "", {"no pose": 2}),
    OpinionRow(
        "output: approach directions", "lambda", 9, 1, 2.0, 0.0, f"output {NASTY}:7", {}
    ),
)


def cells_of(page: Elements) -> list[str]:
    return [told.strip() for told in page.texts if told.strip()]


def test_a_second_opinion_is_a_table_on_the_page() -> None:
    outcome = replace(outcome_of(40), opinion=Opinion("panel.pdl", ROWS, 1.25))
    text = program_report(outcome)
    told = cells_of(Elements(text))
    assert {"Second opinion", "output: place", "< 1e-06 mm", "1 differ"} <= set(told)
    assert "second opinion: disagrees" in text and "Do not upload" in text
    assert "not compared, output: place: 2 (no pose)" in told
    assert any(
        "axis" not in cell and ":7" in cell and "alert(" in cell for cell in told
    )
    assert "<script>alert(" not in text and "\x1b" not in text
    again = program_report_from_json(json.loads(report_text(outcome)), outcome.sources)
    at = slice(text.index('id="second-opinion"'), text.index("Words on this page"))
    assert text[at] in again


def test_without_a_second_opinion_there_is_none() -> None:
    outcome = outcome_of(40)
    assert "Second opinion" not in program_report(outcome)
    data = json.loads(report_text(outcome))
    assert "Second opinion" not in program_report_from_json(data, outcome.sources)
    agrees = replace(outcome, opinion=Opinion("panel.pdl", ROWS[:1], 1.0))
    assert "Do not upload" not in program_report(agrees)


def test_the_page_leads_with_the_verdict():
    html = program_report(outcome_of(60))
    assert (
        html.index('id="verdict"') < html.index('id="left"') < html.index('id="view"')
    )
    assert "are not known" in html  # of an outcome without arrivals


def test_a_report_says_who_and_what():
    data = json.loads(report_text(outcome_of(8)))
    data["head"] |= {"serial_number": "R010", "instrument": "AT960", "operator": None}
    html = program_report_from_json(data)
    assert "<dt>serial number</dt><dd>R010</dd>" in html and "AT960" in html
    assert html.count('<dt>operator</dt><dd><span class="blank"></span></dd>') == 2
    assert "signature: released by" in html
