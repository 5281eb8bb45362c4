"""The list of packages: its page shows it."""

import re
from pathlib import Path

from postproc.language.krl.symbols import package_routines


def test_the_page_shows_the_list():
    page = Path(__file__).parents[3] / "docs" / "routines.md"
    part = page.read_text("utf-8").split("## Routines of KUKA's packages")[1]
    rows = [row for row in part.split("\n## ")[0].splitlines() if row.startswith("| ")]
    shown = [name for row in rows[1:] for name in re.findall(r"`([^`]+)`", row)]
    assert sorted(shown) == sorted(package_routines())


def test_names_are_lower_case_and_stand_once():
    assert all(name == name.lower() for name in package_routines())
    assert set(package_routines().values()) <= {"", "ahead"}
