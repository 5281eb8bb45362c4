"""The documentation: a page's commands print what it says, and the site is whole."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs" / "tools"))

import architecture  # noqa: E402
import causes  # noqa: E402
import file_keys  # noqa: E402
import findings  # noqa: E402
import pages  # noqa: E402
import site_pages  # noqa: E402
from sessions import BLOCK, PAGES, normal, run_page, steps_of  # noqa: E402

from tests.report.html.browser import complaints, open_browser, requests  # noqa: E402

SHORT = ROOT / "docs/howto-messages.md"  # run in seconds; make docs runs all
PHONE = {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": True}


def test_a_page_prints_what_it_says():
    done = subprocess.run(
        [sys.executable, ROOT / "docs/tools/build.py", "--no-site", SHORT],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def options():
    """Read from docs/commands.md which options every command has."""
    text = (ROOT / "docs/commands.md").read_text(encoding="utf-8")
    sections = re.split(r"(?m)^### (\w+)$", text)[1:]
    return {
        name: set(re.findall(r"(?<!\S)--?[a-z][\w-]*", section))
        for name, section in zip(sections[::2], sections[1::2], strict=True)
    }


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_that_are_only_named_exist(page):
    if page.parent.name == "history":
        return  # names what is no more, too
    known, text = options(), page.read_text(encoding="utf-8")
    text = text.replace("\\\n", " ")
    named = r"(?m)(?:`|\$ |\| |^ {4})postproc ([a-z][a-z0-9]*)([^`|\n]*)"
    for name, rest in re.findall(named, text):
        assert name in known, f"{page}: there is no postproc {name}"
        given = set(re.findall(r"(?<!\S)--[a-z][\w-]*", rest))
        assert given <= known[name], f"{page}: postproc {name} has no {given}"
    targets = re.findall(r"(?m)^([\w-]+):", (ROOT / "Makefile").read_text())
    for name in re.findall(r"`(?:\w+=\S+ )?make (\w[\w-]*)", text):
        assert name in targets, f"{page}: there is no make {name}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_files_that_are_only_named_exist(page):
    if page.parent.name == "history":
        return
    text = page.read_text(encoding="utf-8")
    folders = "docs|grammars|native|postproc|programs|tests"
    for name in re.findall(rf"`((?:{folders})/[\w./-]*)`", text):
        assert (ROOT / name).exists(), f"{page}: there is no {name}"


CHANGES = ["Added", "Changed", "Fixed"]
ENTRY = re.compile(r"- [a-z]+: [^\n]+\.")
SHORTEST, LONGEST = 20, 99  # characters of an entry
MOST = 60  # lines of a release


def releases():
    """Return every release of the changelog, with its text."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    parts = re.split(r"(?m)^## (.*)\n", text)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_the_changelog_has_a_release_a_heading_and_no_other():
    found = releases()
    assert found
    for name, text in found.items():
        assert re.fullmatch(r"\d+\.\d+\.\d+", name), name
        headings = re.findall(r"(?m)^#+ (.*)$", text)
        assert headings == [c for c in CHANGES if c in headings], name
        assert headings, name
        assert len(text.strip().splitlines()) <= MOST, name


def test_an_entry_of_the_changelog_is_one_line_of_an_area_and_what_it_does():
    for text in releases().values():
        for line in text.splitlines():
            if line and not line.startswith("### "):
                assert ENTRY.fullmatch(line), line
                assert SHORTEST < len(line) <= LONGEST, f"{len(line)}: {line}"


def test_the_drawing_of_the_chapters_is_that_of_the_code():
    assert list(architecture.problems()) == []


def build(folder):
    """Build the site of the pages in folder/pages, with the settings of ours."""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    text = text.replace("build/pages", "pages").replace("build/docs", "site")
    text = text.replace("paths: [.]", f"paths: [{ROOT}]")
    text = text.replace("[docs/tools/", f"[{ROOT}/docs/tools/")
    if not (folder / "pages" / "tutorial.md").exists():
        text = text.split("\nnav:\n")[0]
    (folder / "mkdocs.yml").write_text(text)
    command = [sys.executable, "-m", "zensical", "build", "--strict"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def test_the_site_is_whole_and_can_be_searched_from_disk(tmp_path):
    pytest.importorskip("zensical", reason="no Zensical: pip install -e '.[docs]'")
    site = tmp_path / "site"
    site_pages.stage(tmp_path / "pages")
    done = build(tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("index", "tutorial", "changelog", "files/programs/drilling.pdl"):
        assert (site / f"{name}.html").stat().st_size > 5000, name
    with open_browser(tmp_path / "profile") as browser:
        browser.get((site / "index.html").as_uri())
        found = search(browser, "backlash")
        assert any("effects.html" in link for link in found)
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
        for name in ("accuracy", "benchmarks", "pdl2", "tutorial"):
            browser.get((site / f"{name}.html").as_uri())
            wide = "return document.documentElement.scrollWidth - innerWidth"
            assert browser.execute_script(wide) <= 0, f"{name} is wider than a phone"
        assert requests(browser) == [] and complaints(browser) == []


def test_a_link_or_a_heading_that_is_not_there_fails(tmp_path):
    pytest.importorskip("zensical", reason="no Zensical: pip install -e '.[docs]'")
    folder = tmp_path / "pages"
    folder.mkdir()
    (folder / "other.md").write_text("# Other\n")
    for target in ("none.md", "#none", "other.md#none", "../none.md"):
        (folder / "index.md").write_text(f"# Home\n\n[a]({target})\n")
        assert build(tmp_path).returncode != 0, target
    (folder / "index.md").write_text("# Home\n\n[a](other.md#other)\n")
    assert build(tmp_path).returncode == 0


def test_a_link_to_a_file_that_is_not_there_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("[a](none.txt), ![b](none.png), [c](page.md), [d](https://e.org)")
    assert [text.split()[-1] for text in site_pages.dead_links([page])] == [
        "none.txt",
        "none.png",
    ]


LINKS_OF_SEARCH = """
    const places = [...document.querySelectorAll("*")].filter((e) => e.shadowRoot);
    const links = places.map((e) => [...e.shadowRoot.querySelectorAll("li a")]);
    return links.flat().map((link) => link.href);
"""


def search(browser, word, seconds=10.0):
    """Type a word into the search of the site; return where its results lead."""
    browser.find_element("css selector", ".md-search__button").click()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        browser.switch_to.active_element.send_keys(word)
        time.sleep(0.5)
        if found := browser.execute_script(LINKS_OF_SEARCH):
            return found
    raise AssertionError(f"the search finds no {word}")


def page(*lines: str) -> str:
    return "\n".join(["# Page", "", "```console", *lines, "```", "", "Text."]) + "\n"


def test_a_stale_output_is_found_and_mended(tmp_path):
    text = page(
        "$ echo one", "two", "$ cat > a <<'END'", "> x", "> END", "$ cat a", "x"
    )
    new, wrong = run_page(text, tmp_path)
    assert new == text.replace("two", "one") and len(wrong) == 1
    assert "-two" in wrong[0] and "+one" in wrong[0]
    assert run_page(new, tmp_path) == (new, [])


def test_exit_codes_and_standard_error_are_part_of_the_output(tmp_path):
    text = page("$ echo bad >&2; exit 3", "bad", "[exit code 3]")
    assert run_page(text, tmp_path) == (text, [])
    assert run_page(text.replace("3]", "4]"), tmp_path)[1]


def test_only_times_and_the_folder_are_taken_to_be_equal(tmp_path):
    assert normal("in 1.5 s") == normal("in 12 s") != normal("in 12 mm")
    text = page("$ pwd; echo took 3.25 s; echo $PWD/a.csv", str(tmp_path), "took 1 s",
                "a.csv")  # fmt: skip
    assert run_page(text, tmp_path)[1] == []


def test_progress_of_a_slow_machine_is_no_part_of_the_output(tmp_path):
    text = page("$ echo '12 s: report' >&2; echo '3 s of travel'", "3 s of travel")
    assert run_page(text, tmp_path) == (text, [])


def test_a_block_begins_with_a_command():
    with pytest.raises(ValueError, match="begins with output"):
        steps_of("output\n$ a\n")
    assert BLOCK.findall("```text\n$ a\n```\n") == []


def test_the_table_of_causes_is_that_of_the_effects():
    page = causes.PAGE.read_text(encoding="utf-8")
    assert causes.BEGIN in page
    assert causes.written(page) == page, "run python docs/tools/causes.py"


def test_the_page_of_findings_is_that_of_the_registry():
    page = findings.PAGE.read_text(encoding="utf-8")
    assert page == findings.written(), "run python docs/tools/findings.py"


def test_the_page_of_files_is_that_of_their_classes():
    text = file_keys.PAGE.read_text(encoding="utf-8")
    assert text == file_keys.written(), "run python docs/tools/file_keys.py"


def test_every_page_is_short_enough():
    assert pages.too_long() == []


def test_few_sentences_of_pages_break_a_rule():
    found = pages.suspects()
    assert len(found) <= pages.ALLOWED, "\n".join(map(str, found))
    assert pages.faults("It is what that does, where which is so.")
    assert pages.faults("The arm misses its targets by 0.1 mm.") == []


def test_every_page_has_a_place_in_the_navigation():
    known = {page.path.resolve() for page in pages.pages()}
    assert {path.resolve() for path in site_pages.sources()} <= known
