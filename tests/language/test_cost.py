"""docs/studies/languages.md says what a language costs."""

import re

import pytest

from tests.language.cost import ROOT, table


def test_the_page_says_what_a_language_costs() -> None:
    text = (ROOT / "docs" / "studies" / "languages.md").read_text(encoding="utf-8")
    page = text.split("## What a language costs")[1].splitlines()
    for row in table()[2:]:  # below the head
        name, *counted = re.split(r"(?<=[|] )([\d,]+)(?= lines)", row)
        (told,) = (line for line in page if line.startswith(name))
        said = re.split(r"(?<=[|] )([\d,]+)(?= lines)", told)[1:]
        assert counted[1::2] == said[1::2]
        for one, two in zip(counted[::2], said[::2], strict=True):
            figures = (float(figure.replace(",", "")) for figure in (one, two))
            assert next(figures) == pytest.approx(next(figures), rel=0.1), row
