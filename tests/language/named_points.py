"""The targets of a written job under names, or as elements of an array."""

from __future__ import annotations

import re
from collections.abc import Mapping

INLINE = {
    "job.mod": re.compile(r"(MoveL) (\[\[.*?9E9\]\])"),
    "job.src": re.compile(r"(SLIN) (\{.*?\})"),
    "job.pdl": re.compile(r"(LINEAR TO) (POS\(.*?\))"),
}


def name_points(
    files: Mapping[str, bytes], name: str, in_array: bool
) -> dict[str, bytes]:
    """Give every target of a line a name, or make it an element of an array."""
    points, again = dict[str, str](), {k: v.decode() for k, v in files.items()}

    def to(found: re.Match[str]) -> str:
        k = len(points) + 1
        bracket = "{}" if name == "job.mod" else "[]"
        own = f"pts{bracket[0]}{k}{bracket[1]}" if in_array else f"p{k}"
        points[own] = found[2]
        return f"{found[1]} {own}"

    text, n = INLINE[name].sub(to, again[name]), len(points)
    if name == "job.src":
        kind = "" if in_array else "DECL E6POS "
        lines = [f"{kind}{own}={value}" for own, value in points.items()]
        lines = ([f"DECL E6POS pts[{n}]"] if in_array else []) + lines
        again["job.dat"] = again["job.dat"].replace(
            "ENDDAT", "\n".join([*lines, "ENDDAT"])
        )
    elif name == "job.mod":
        lines = [f"CONST robtarget {own}:={value};" for own, value in points.items()]
        if in_array:
            values = ",".join(points.values())
            lines = [f"CONST robtarget pts{{{n}}}:=[{values}];"]
        text = text.replace("  PROC main()", "\n".join([*lines, "  PROC main()"]), 1)
    else:
        types = [f"{own} : POSITION" for own in points]
        types = [f"pts : ARRAY[{n}] OF POSITION"] if in_array else types
        text = text.replace("BEGIN", "\n".join(["VAR", *types, "BEGIN"]), 1)
        lines = [f"pts APOS [{n}] Priv"] if in_array else []
        for k, value in enumerate(points.values(), start=1):
            *six, config = value[4:-1].split(", ")
            own = " ".join(map(": ".join, zip("XYZAER", six, strict=True)))
            head = f" [{k}]:" if in_array else f"p{k} POS Priv\n"
            lines.append(f"{head} {own}\n CNFG: {config}")
        again["job.lsv"] = "\n".join([*lines, ""])
    return {k: v.encode() for k, v in (again | {name: text}).items()}
