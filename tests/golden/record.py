"""What a case printed and wrote, as text to be compared."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from itertools import zip_longest

Record = dict[str, str]  # what -> text; bytes stand in it as Latin-1
Digest = dict[str, str | list[float]]

FLOAT = re.compile(r"-?\d+\.\d+(?:[eE][-+]?\d+)?|-?\d+[eE][-+]?\d+")
NUMBERS = (".json", ".jsonl", ".csv")  # of these, numbers are compared as numbers
BINARY = (".png", ".pdf")
LOGS = (".jsonl",)
CLOSE = 1e-9  # relative, and absolute
SHORT = 80  # characters that a digest holds as they are
WEIGHTS = (0.7390851, 1.8954943, 2.7682811)
TIMES = (
    (re.compile(r'("stages_s": *)\{[^{}]*\}'), r'\1"<times>"'),
    (re.compile(r'("(?:seconds|time)": *)[\d.eE+-]+'), r'\1"<time>"'),
    (re.compile(r'("(?:model_)?date": *)"[\d-]+"'), r'\1"<date>"'),
    (re.compile(r"(<dt>date</dt><dd>)[\d-]+"), r"\1<date>"),
    (re.compile(r"(, fitted on )[\d-]{10}(?=<)"), r"\1<date>"),
    (re.compile(r"fitted on [\d-]{10} by postproc \S+"), "fitted on <date>"),
    (re.compile(r'">[\d.]+ s(</td><td class="wide"><meter )[^<]*'), r'"><time>\1'),
)  # fmt: skip
PLOTLY = re.compile(r"<script>/\*\*\n\* plotly\.js .*?</script>", re.S)
IDS = re.compile(r"\b(?=[0-9a-f]*[0-9])(?:[0-9a-f]{64}|[0-9a-f]{16}|[0-9a-f]{12})\b")


def masked(text: str, names: dict[str, str], fitted: bool) -> str:
    """Replace what differs between two runs though nothing changed.

    Args:
        text: What was printed or written.
        names: Folders and versions, and what stands for them.
        fitted: Ids of models follow their last digits: mask them too.
    """
    for name, stands in names.items():
        text = text.replace(name, stands)
    for pattern, stands in TIMES:
        text = pattern.sub(stands, text)
    if text.startswith("<!"):
        text = PLOTLY.sub("<script>plotly.js</script>", text)
    return IDS.sub("<id>", text) if fitted else text


def in_order(what: str, text: str) -> str:
    """Sort the lines of a log: two workers end their programs in any order."""
    return "\n".join(sorted(text.split("\n"))) if what.endswith(LOGS) else text


def is_numbers(what: str, text: str, fitted: bool) -> bool:
    """Tell whether the numbers of a text are compared as numbers."""
    return fitted or what.endswith(NUMBERS) or text[:1] in ("{", "[")


def differences(old: Record, new: Record, fitted: bool) -> list[str]:
    """Tell what differs between two records of a case."""
    found = [f"{what}: no longer there" for what in old if what not in new]
    found += [f"{what}: new" for what in new if what not in old]
    for what in old.keys() & new.keys():
        a, b = in_order(what, old[what]), in_order(what, new[what])
        if a == b:
            continue
        if is_numbers(what, a, fitted) and (why := numbers_differ(a, b)) is not None:
            found += [f"{what}: {why}"] if why else []
        else:
            found.append(f"{what}: {first_difference(a, b)}")
    return sorted(found)


def numbers_differ(a: str, b: str) -> str | None:
    """Compare numbers by size: None where other things differ too, "" where close."""
    if FLOAT.sub("#", a) != FLOAT.sub("#", b):
        return None
    for x, y in zip(FLOAT.finditer(a), FLOAT.finditer(b), strict=True):
        if not math.isclose(float(x[0]), float(y[0]), rel_tol=CLOSE, abs_tol=CLOSE):
            before = a[max(0, x.start() - 60) : x.start()].replace("\n", " ")
            return f"..{before}[{x[0]} -> {y[0]}]"
    return ""


def first_difference(a: str, b: str) -> str:
    """Show the first lines that differ, round the first character that does."""
    lines = zip_longest(a.split("\n"), b.split("\n"))
    for number, (old, new) in enumerate(lines, 1):
        if old != new:
            return f"line {number}\n    - {around(old, new)}\n    + {around(new, old)}"
    return "nothing"


def around(line: str | None, other: str | None) -> str:
    """Cut out of a line what stands round its first difference from another."""
    if line is None:
        return "(end)"
    pairs = enumerate(zip_longest(line, other or ""))
    at = next((i for i, (x, y) in pairs if x != y), 0)
    start = max(0, at - 80)
    return f"{'..' if start else ''}{line[start : at + 80]!r}"


def digest(record: Record, fitted: bool) -> Digest:
    """Shorten a record to what is kept with the sources."""
    found: Digest = {}
    for what, text in sorted(record.items()):
        text = in_order(what, text)
        if is_numbers(what, text, fitted):
            numbers = [float(n) for n in FLOAT.findall(text)]
            found[what] = sha(FLOAT.sub("#", text))
            found[f"{what} numbers"] = [float(len(numbers)), *sums(numbers)]
        else:
            found[what] = text if len(text) <= SHORT else sha(text)
    return found


def sums(numbers: list[float]) -> Iterator[float]:
    """Yield the largest of some numbers, and sums of them with fixed weights."""
    finite = [n for n in numbers if math.isfinite(n)]
    yield max(map(abs, finite), default=0.0)
    for w in WEIGHTS:
        yield math.fsum(n * math.sin(w * (i + 1)) for i, n in enumerate(finite))


def digests_differ(old: Digest, new: Digest) -> list[str]:
    """Tell what differs between two digests of a case."""
    both = sorted(old.keys() | new.keys())
    return [what for what in both if not same(old.get(what), new.get(what))]


def same(a: str | list[float] | None, b: str | list[float] | None) -> bool:
    """Compare two entries of digests."""
    if not isinstance(a, list) or not isinstance(b, list):
        return a == b
    near = CLOSE * max(1.0, a[1])
    return len(a) == len(b) and a[0] == b[0] and all(
        math.isclose(x, y, rel_tol=0.0, abs_tol=near) for x, y in zip(a, b, strict=True)
    )  # fmt: skip


def sha(text: str) -> str:
    """Hash a text."""
    return "sha256 " + hashlib.sha256(text.encode("latin-1", "replace")).hexdigest()
