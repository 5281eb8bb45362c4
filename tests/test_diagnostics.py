"""The registry of findings: every code is explained."""

from __future__ import annotations

import re

import pytest

from postproc.diagnostics import Code, Severity


@pytest.mark.parametrize("code", Code)
def test_a_code_says_what_it_means_and_what_to_do(code):
    assert re.fullmatch(r"[a-z]+(-[a-z]+)*", code)
    assert code.name == code.upper().replace("-", "_")
    assert code.meaning.endswith((".", "?"))
    assert code.cure.endswith((".", "?")) or (
        code.severity is Severity.NOTE and not code.cure
    )
