"""The documentation: links lead somewhere, a page's commands print what it says."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
sys.path.insert(0, str(DOCS / "tools"))

from links import anchor, broken_links  # noqa: E402
from sessions import BLOCK, normal, run_page, steps_of  # noqa: E402

PAGES = sorted(DOCS.glob("*.md"))
SHORT = "howto-messages.md"  # a page that is run in seconds; make docs runs all


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    assert list(broken_links(page)) == []


def test_every_page_is_in_the_list():
    listed = (DOCS / "README.md").read_text(encoding="utf-8")
    for page in PAGES:
        assert page.stem == "README" or f"({page.name})" in listed, page


def test_a_page_prints_what_it_says():
    done = subprocess.run(
        [sys.executable, DOCS / "tools" / "build.py", "--no-html", SHORT],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


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


def test_a_block_begins_with_a_command():
    with pytest.raises(ValueError, match="begins with output"):
        steps_of("output\n$ a\n")
    assert BLOCK.findall("```text\n$ a\n```\n") == []


def test_anchors_are_those_of_code_hosts():
    assert anchor("What `diff` shows: a, b") == "what-diff-shows-a-b"
