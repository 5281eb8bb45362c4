"""How many lines a language costs: python -m tests.language.cost."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
GRAMMARS = {"PDL2": ("pdl2", "lsv"), "RAPID": ("rapid",), "KRL": ("krl",)}
FOLDERS = {
    "PDL2": ("pdl2/",),
    "RAPID": ("rapid/",),
    "KRL": ("krl/",),
    "all languages": ("", "text/", "analysis/"),
}


def lines(path: Path) -> int:
    """Count the lines of a file."""
    return len(path.read_text(encoding="utf-8").splitlines())


def table() -> list[str]:
    """Write the table of docs/studies/languages.md, Python to the hundred lines."""
    rows = ["| | grammar | Python |", "|---|---|---|"]
    for name, folders in FOLDERS.items():
        names = [f"{part}.lark" for part in GRAMMARS.get(name, ())]
        count = sum(lines(ROOT / "grammars" / one) for one in names)
        grammar = f"{count} lines ({', '.join(f'`{one}`' for one in names)})"
        places = [ROOT / "postproc/language" / folder for folder in folders]
        paths = (path for place in places for path in place.glob("*.py"))
        code = round(sum(map(lines, paths)), -2)
        shown = ", ".join(f"`language/{folder}`" for folder in folders)
        rows.append(
            f"| {name} | {grammar if names else ''} | {code:,} lines ({shown}) |"
        )
    return [row.replace("|  |", "| |") for row in rows]


def fourth() -> dict[str, int]:
    """Return what files of a fourth language would have, by the smaller of two.

    Those are the files that RAPID and KRL both have.
    """
    rapid, krl = (ROOT / "postproc/language" / name for name in ("rapid", "krl"))
    names = sorted({one.name for one in rapid.glob("[a-z]*.py")})
    both = [name for name in names if (krl / name).exists()]
    return {name: min(lines(rapid / name), lines(krl / name)) for name in both}


if __name__ == "__main__":
    print("\n".join(table()))
    cost = fourth()
    print(f"a fourth: {sum(cost.values()):,} lines in {len(cost)} files")
