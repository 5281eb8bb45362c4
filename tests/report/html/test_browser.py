"""The pages in a real browser, opened from disk.

``SCREENSHOTS=FOLDER`` keeps a picture of every page there.
"""

from __future__ import annotations

import base64
import io
import json
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from postproc.report.html import (
    calibration_report,
    comparison_report,
    diagnosis_report,
    program_report,
    program_report_from_json,
)
from postproc.report.json import report_text
from tests.report.html.browser import complaints, open_browser, requests
from tests.report.html.builders import FIRST_LINE, outcome_of
from tests.report.html.test_program import NASTY
from tests.report.html.test_reports import comparison, diagnosis, fit_of, model_file

PATIENCE = 60  # seconds; the machine may be busy with other tests
MANY = 100_000

READY = """
const trouble = document.getElementById("trouble");
if (trouble && !trouble.hidden) throw new Error(trouble.textContent);
return document.body !== null && document.body.dataset.ready === "yes";
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="module")
def browser(folder: Path) -> Iterator[Any]:
    with open_browser(folder / "profile") as opened:
        yield opened


def show(browser: Any, folder: Path, name: str, text: str) -> None:
    """Write a page, open it from disk, and wait until it is drawn."""
    place = folder / f"{name}.html"
    place.write_text(text, encoding="utf-8")
    complaints(browser)
    requests(browser)
    browser.get(f"file://{place}")
    until(browser, READY)
    picture(browser, name)


def until(browser: Any, script: str) -> None:
    """Wait until a script returns something true."""
    end = time.monotonic() + PATIENCE
    while not browser.execute_script(script):
        assert time.monotonic() < end, f"not within {PATIENCE} s: {script}"
        time.sleep(0.05)


def picture(browser: Any, name: str) -> None:
    """Keep a picture of the page, if somebody wants it."""
    wanted = os.environ.get("SCREENSHOTS")
    if wanted:
        Path(wanted).mkdir(parents=True, exist_ok=True)
        browser.save_screenshot(str(Path(wanted) / f"{name}.png"))


def texts(browser: Any, column: str) -> list[str]:
    """Return a column of the table as it stands on the page."""
    found: list[str] = browser.execute_script(
        """
        const heads = [...document.querySelectorAll("#targets th")];
        const at = heads.findIndex((th) => th.dataset.key === arguments[0]);
        return [...document.querySelectorAll("#targets tbody tr")]
          .map((row) => row.children[at].textContent);
        """,
        column,
    )
    return found


def selected_visit(browser: Any) -> str:
    """Return the number of the visit that is marked in the table."""
    row = browser.find_element("css selector", "#targets tr.selected td")
    return str(row.text)


def click(browser: Any, selector: str) -> None:
    """Click an element as a user does: where it is on the screen."""
    node = browser.find_element("css selector", selector)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", node)
    node.click()


def type_search(browser: Any, text: str) -> None:
    """Type into the search field, in place of what stands there."""
    field = browser.find_element("css selector", "#search")
    field.clear()
    field.send_keys(text)


def keep(name: str, data: bytes) -> None:
    """Keep a file beside the pictures, if somebody wants them."""
    wanted = os.environ.get("SCREENSHOTS")
    if wanted:
        Path(wanted).mkdir(parents=True, exist_ok=True)
        (Path(wanted) / name).write_bytes(data)


@pytest.fixture
def program(browser: Any, folder: Path) -> Any:
    outcome = outcome_of(250, names=("", "hole_1", NASTY), extra=NASTY)
    show(browser, folder, "program", program_report(outcome))
    return browser


PAGES = {
    "program": lambda: program_report(outcome_of(250, names=("", NASTY), extra=NASTY)),
    "empty": lambda: program_report(outcome_of(0)),
    "model": lambda: calibration_report(model_file(NASTY)),
    "fit": lambda: calibration_report(model_file(), fit_of()),
    "diagnosis": lambda: diagnosis_report(diagnosis()),
    "comparison": lambda: comparison_report(comparison()),
}


@pytest.mark.parametrize("name", PAGES)
def test_pages_open_quietly(browser: Any, folder: Path, name: str) -> None:
    show(browser, folder, name, PAGES[name]())
    assert requests(browser) == []
    assert complaints(browser) == []
    assert not browser.find_elements("css selector", "[data-title*='Share']")
    wide, window = browser.execute_script(
        "return [document.documentElement.scrollWidth, window.innerWidth]"
    )
    assert wide <= window  # nothing sticks out of a laptop's screen


def test_a_row_leads_to_the_view_and_the_source(program: Any) -> None:
    click(program, "#targets tbody tr[data-row='11']")
    here = program.find_element("css selector", "#detail .here").text
    assert str(FIRST_LINE + 11) in here and "MOVEFLY LINEAR TO POS(" in here
    drawn = program.execute_script(
        "const t = document.getElementById('view').data.find((t) => t.name === "
        "'selected'); return [t.x[0], t.y[0], t.z[0]].map(Number)"
    )
    wanted = outcome_of(250).position[11] * 1e3
    assert drawn == pytest.approx(wanted.tolist(), abs=0.01)
    picture(program, "selected")


def test_a_target_shows_the_shares_of_the_effects(browser: Any, folder: Path) -> None:
    data = json.loads(report_text(outcome_of(30)))
    for target in data["targets"]:
        target["share_mm"] = {"backlash": 0.125, "<b>x</b>": 0.5, "thermal": None}
        target |= {
            "nonparametric_mm": [0.3, 0.0, 0.4],
            "nonparametric_std_mm": [0.0, 0.03, 0.04],
        }
    show(browser, folder, "shares", program_report_from_json(data))
    click(browser, "#targets tbody tr[data-row='11']")
    rows = browser.find_elements("css selector", "#detail .shares tbody tr")
    told = [row.text.rsplit(None, 1) for row in rows]
    assert told == [["<b>x</b>", "0.5000"], ["backlash", "0.1250"], ["thermal", "–"]]
    bars = "return [...document.querySelectorAll('#detail meter')].map((m) => m.value)"
    assert browser.execute_script(bars) == [0.5, 0.125, 0]
    detail = browser.find_element("css selector", "#detail").text
    assert "error 0.3000 0.0000 0.4000 0.5000" in detail
    assert "± std error 0.0000 0.0300 0.0400 0.0500" in detail
    assert complaints(browser) == []
    picture(browser, "shares")
    bare = program_report(outcome_of(30))
    show(browser, folder, "bare", bare)
    click(browser, "#targets tbody tr[data-row='11']")
    assert not browser.find_elements("css selector", "#detail .shares")
    assert "free forms" not in browser.find_element("css selector", "#detail").text


def test_a_click_into_the_view_leads_to_the_row(program: Any) -> None:
    from selenium.webdriver import ActionChains

    view = program.find_element("css selector", "#view")
    program.execute_script("arguments[0].scrollIntoView({block: 'center'})", view)
    size, label = view.size, "return document.querySelector('#view .hovertext')"
    for k in range(400):  # somewhere along a grid there is a target
        x = (k % 40 - 20) * size["width"] / 120
        y = (k // 40 - 5) * size["height"] / 24
        pointer = ActionChains(program, duration=0)
        pointer.move_to_element_with_offset(view, x, y).perform()
        if program.execute_script(label):
            time.sleep(0.3)  # the label may be that of the point before
            if program.execute_script(label):
                break
    else:
        pytest.fail("no target under the pointer anywhere")
    told = program.execute_script(f"{label}.textContent").split()
    ActionChains(program).click().perform()
    until(program, "return document.querySelector('#targets tr.selected') !== null")
    assert told[0] == "target" and told[1] == selected_visit(program)
    here = program.find_element("css selector", "#detail .here").text
    assert str(FIRST_LINE + int(told[1]) - 1) in here


def test_links_of_what_was_left_alone_lead_to_it(program: Any) -> None:
    click(program, "#left a")
    until(program, "return !!document.querySelector('#targets tr.selected');")
    selected = program.find_element("css selector", "#targets tr.selected")
    assert "conflict" in selected.text


def test_statuses_filter_table_and_view(program: Any) -> None:
    for status in ("corrected", "runtime", "unchanged"):
        boxes = program.find_elements("css selector", "#statuses label")
        next(b for b in boxes if f" {status} " in b.text).click()
    shown = texts(program, "status")
    assert len(shown) == 14 and {s[2:] for s in shown} == {"conflict", "rejected"}
    until(
        program,
        "const names = document.getElementById('view').data.map((t) => t.name || '');"
        "return !names.some((n) => n.startsWith('corrected'))"
        " && names.some((n) => n.startsWith('rejected'))",
    )


def test_search_looks_at_names_lines_reasons_and_text(program: Any) -> None:
    for text, count in (("singularity", 7), ("hole_1", 83), (f"{FIRST_LINE + 7}", 1)):
        type_search(program, text)
        where = program.find_element("css selector", "#where").text
        found = int(where.split()[-1]) if "of" in where else 0
        assert found >= count, (text, where)
    type_search(program, "no such thing")
    assert program.find_element("css selector", "#where").text == "no target matches"
    type_search(program, "singularity")
    assert all("singularity" in why for why in texts(program, "why"))


def test_columns_sort_both_ways(program: Any) -> None:
    for wanted in ("descending", "ascending"):
        click(program, "#targets th[data-key='size'] button")
        head = program.find_element("css selector", "#targets th[data-key='size']")
        assert head.get_attribute("aria-sort") == wanted
        shown = [float(v) for v in texts(program, "size") if v]
        assert len(shown) == 100
        assert shown == sorted(shown, reverse=wanted == "descending")


def test_pages_turn_and_keys_walk(program: Any) -> None:
    click(program, "#later")
    assert texts(program, "visit")[0] == "101"
    click(program, "#targets tbody tr[data-row='199']")
    program.switch_to.active_element.send_keys("\ue015")  # arrow down: next page
    row = program.find_element("css selector", "#targets tr.selected")
    assert row.get_attribute("data-row") == "200"
    assert texts(program, "visit")[0] == "201"


def test_names_stay_text_on_the_page(program: Any) -> None:
    assert "<script>" in texts(program, "name")[2]
    assert not any("alert(" in t for t in scripts(program))


def scripts(browser: Any) -> list[str]:
    """Return the short scripts of a page: plotly's own is not ours to judge."""
    found: list[str] = browser.execute_script(
        "return [...document.scripts].filter((s) => !s.type && s.textContent.length "
        "< 100000).map((s) => s.textContent)"
    )
    return found


@pytest.mark.parametrize("mode", ["size", "1", "6"])
def test_classes_are_told_by_symbols_too(program: Any, mode: str) -> None:
    program.execute_script(
        "const m = document.getElementById('mode'); m.value = arguments[0];"
        "m.dispatchEvent(new Event('change'));",
        mode,
    )
    until(
        program,
        "return !document.getElementById('view').data"
        ".some((t) => (t.name || '').startsWith('corrected'))",
    )
    kinds = program.execute_script(
        "return document.getElementById('view').data.filter((t) => t.customdata)"
        ".map((t) => [t.marker.symbol, t.marker.color])"
    )
    assert len(kinds) >= 2
    assert len({symbol for symbol, _ in kinds}) == len({c for _, c in kinds})
    assert len({symbol for symbol, _ in kinds}) == len(kinds)


def test_the_page_prints(program: Any, folder: Path) -> None:
    pdf = base64.b64decode(program.execute_cdp_cmd("Page.printToPDF", {})["data"])
    assert pdf.startswith(b"%PDF") and len(pdf) > 20_000
    marks = program.execute_script(
        """
        window.dispatchEvent(new Event("beforeprint"));
        const copy = document.querySelector("#view canvas.printed");
        const { width, height } = copy;
        const { data } = copy.getContext("2d").getImageData(0, 0, width, height);
        let blue = 0;
        for (let k = 0; k < data.length; k += 4) blue += data[k + 2] > data[k] + 80;
        window.dispatchEvent(new Event("afterprint"));
        return [blue, document.querySelectorAll("canvas.printed").length];
        """
    )
    assert marks[0] > 100 and marks[1] == 0  # targets are drawn in blue
    keep("program.pdf", pdf)


def test_wide_figures_fit_on_a_sheet_and_come_back(browser: Any, folder: Path) -> None:
    show(browser, folder, "diagnosis", diagnosis_report(diagnosis()))
    told = """
        window.dispatchEvent(new Event(arguments[0]));
        return [...document.querySelectorAll(".js-plotly-plot .main-svg")]
          .map((svg) => svg.getBoundingClientRect().width);
    """
    on_screen = browser.execute_script(told, "nothing")
    assert max(browser.execute_script(told, "beforeprint")) <= 701 < max(on_screen)
    browser.execute_script(told, "afterprint")
    until(
        browser,
        "return Math.max(...[...document.querySelectorAll('.main-svg')]"
        ".map((svg) => svg.getBoundingClientRect().width)) > 701",
    )
    pdf = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", {})["data"])
    keep("diagnosis.pdf", pdf)


def test_a_target_far_away_does_not_spoil_the_view(browser: Any, folder: Path) -> None:
    outcome = outcome_of(60)
    far = np.array(outcome.position)
    far[7] = [0.0, 90.0, 0.0]
    page = program_report(replace(outcome, position=far))
    show(browser, folder, "far", page)
    aspect = browser.execute_script(
        "const s = document.getElementById('view')._fullLayout.scene;"
        "return [s.aspectmode, s.aspectratio.x, s.aspectratio.y, s.aspectratio.z]"
    )
    assert aspect[0] == "manual" and max(aspect[1:]) == pytest.approx(1.5)
    assert min(aspect[1:]) > 0.1


def test_words_are_explained_on_every_page(browser: Any, folder: Path) -> None:
    for name in ("program", "fit", "diagnosis"):
        show(browser, folder, name, PAGES[name]())
        words = browser.find_elements("css selector", ".words dt")
        assert len(words) > 5 and all(word.text for word in words)


@pytest.mark.slow
def test_100_000_targets_are_usable(browser: Any, folder: Path) -> None:
    show(browser, folder, "large", program_report(outcome_of(MANY)))
    assert requests(browser) == [] and complaints(browser) == []
    assert texts(browser, "visit") == [str(k) for k in range(1, 101)]
    drawn = browser.execute_script(
        "return document.getElementById('view').data"
        ".reduce((n, t) => n + (t.customdata || []).length, 0)"
    )
    assert 5_000 < drawn <= 20_000
    assert "every k-th" in browser.find_element("css selector", "#view-note").text
    type_search(browser, "singularity")
    where = browser.find_element("css selector", "#where").text
    assert where == "1 to 100 of 2500"
    note = "return document.getElementById('view-note').textContent.includes('evenly')"
    until(browser, note.replace("return ", "return !"))  # all 2,500 are drawn now
    click(browser, "#targets tbody tr")
    assert browser.find_element("css selector", "#detail .here").text


def test_all_targets_are_printed(program: Any) -> None:
    count = "return document.querySelectorAll('#all-targets tbody tr').length"
    program.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    assert program.execute_script(count) == 250
    program.execute_script("window.dispatchEvent(new Event('afterprint'))")
    assert program.execute_script(count) == 0


def test_a_workbook_holds_every_table(program: Any) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    program.set_script_timeout(30)
    data = program.execute_async_script(
        "const done = arguments[0]; new Blob(Workbook.make()).arrayBuffer().then((a) "
        "=> done([...new Uint8Array(a)]))"
    )
    book = openpyxl.load_workbook(io.BytesIO(bytes(data)))
    assert book["targets"].max_row == 251
    row = [cell.value for cell in book["targets"][2]]
    assert row[0] == 1 and isinstance(row[1], int | float)
    text = program.execute_script("return Sheets.csv([['=a', -1, 'b\"c']])")
    assert text == '\'=a,-1,"b""c"\r\n'
