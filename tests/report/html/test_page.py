from __future__ import annotations

import base64
import gzip
import json

import numpy as np
import pytest

from postproc.report.html import page
from postproc.report.html.page import short, visible

NASTY = "</script><script>alert(1)</script>\x00\x1b[2J\u2028\u202e'\"&"


def test_data_cannot_leave_their_element() -> None:
    kind, text = page.embed({"name": NASTY})
    assert kind == page.PLAIN
    assert not set("<>&") & set(text)
    assert text.isascii() and text.isprintable()
    assert json.loads(text) == {"name": NASTY}


def test_large_data_are_packed() -> None:
    payload = {"names": [NASTY] * (page.PLAIN_BYTES // 20)}
    kind, text = page.embed(payload)
    assert kind == page.PACKED
    assert len(text) < page.PLAIN_BYTES / 10
    assert json.loads(gzip.decompress(base64.b64decode(text))) == payload


def test_the_same_data_give_the_same_bytes() -> None:
    payload = {"names": list(range(page.PLAIN_BYTES // 4))}
    assert page.embed(payload) == page.embed(payload)


def test_what_json_does_not_have_is_refused() -> None:
    with pytest.raises(ValueError, match="JSON"):
        page.embed({"value": float(np.nan)})


def test_the_policy_lets_only_our_scripts_run() -> None:
    policy = page.policy(["let a = 1;"])
    # echo -n 'let a = 1;' | openssl dgst -sha256 -binary | base64
    assert "script-src 'sha256-" in policy
    assert "unsafe-inline'" not in policy.split("style-src")[0]
    assert policy.startswith("default-src 'none'")
    assert page.policy(["let a = 2;"]) != policy


def test_no_script_of_ours_ends_its_element() -> None:
    names = ("page.js", "columns.js", "view.js", "table.js", "source.js", "program.js")
    for name in (*names, "figures.js"):
        assert "</script" not in page.asset(name).lower()
        assert "innerHTML" not in page.asset(name)
    assert "</script" not in page.plotly_js().lower()


def test_plotly_stands_in_a_page_in_less_than_half_its_size() -> None:
    """And comes out as it is: the policy has its digest."""
    packed, whole = page.packed_plotly(), page.plotly_js()
    assert gzip.decompress(base64.b64decode(packed)).decode("utf-8") == whole
    assert len(packed) < 0.45 * len(whole)
    assert whole.startswith("/**") and "\r" not in whole


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain", "plain"),
        ("B\xfcgel", "B\xfcgel"),
        ("a\tb", "a   b"),
        ("a\rb\n", "a\\x0db\\x0a"),
        ("\x9b31m", "\\x9b31m"),
        ("\u202egnp", "\\u202egnp"),
        ("\ud800", "\\ud800"),
    ],
)
def test_hidden_characters_are_shown(text: str, shown: str) -> None:
    assert visible(text) == shown
    assert visible(shown) == shown


def test_long_texts_are_cut() -> None:
    assert short("abc", 3) == "abc"
    assert short("abcd", 3) == "ab…"
