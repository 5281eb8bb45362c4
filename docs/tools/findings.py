"""Write docs/findings.md from the registry of findings.

python docs/tools/findings.py
"""

from __future__ import annotations

from pathlib import Path

from postproc.diagnostics import Code, Severity

PAGE = Path(__file__).parents[1] / "findings.md"
HEAD = """# Findings

Written from `postproc/diagnostics.py` by `python docs/tools/findings.py`.

A finding is one message about a program, or about a tree of compensated programs. It
names a file and a line, and has a code: `job.pdl:12: unknown-routine: ..`. JSON outputs
carry the code; `postproc explain --code CODE` prints its meaning and cure. Equal
findings at many lines are printed as one, with the first; `compensate --all` lists
each.

The reason why a target is not corrected has a code of the same registry. JSON
outputs carry that code (`code`) beside the text.

| severity | what it asks for |
|---|---|
| note | nothing: it reports what was done, or assumed |
| warning | a check: targets keep their values, or are less certain |
| error | a change: as it is the program must not be uploaded |
"""


def written() -> str:
    """Write the page."""
    parts = [HEAD]
    for severity in (Severity.ERROR, Severity.WARNING, Severity.NOTE):
        parts.append(f"## {severity.capitalize()}s\n")
        parts.append("| code | meaning | cure |\n|---|---|---|")
        rows = sorted(code for code in Code if code.severity == severity)
        parts += [f"| `{one}` | {one.meaning} | {one.cure} |" for one in rows]
        parts.append("")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
