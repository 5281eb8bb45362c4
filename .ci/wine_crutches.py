"""Write sources of what Wine 8 lacks and every Windows since 10 has.

    python .ci/wine_crutches.py FOLDER EXPORTS_OF_PYTHON EXPORTS_OF_UCRTBASE

`bcryptprimitives.dll` with ProcessPrng, which Rust seeds its hashes with; `python3.dll`
that forwards to `python311.dll`, which the CPython at hand lacks; `ucrtbase.dll` that
forwards to Wine's own, named `winecrt.dll`, and has the complex functions of C.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

RANDOM = """#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);
__declspec(dllexport) BOOL ProcessPrng(PBYTE data, SIZE_T size) {
    return SystemFunction036(data, (ULONG)size);
}
"""
COMPLEX = """#include <complex.h>
typedef struct { double r, i; } D;
typedef struct { float r, i; } F;
static double _Complex d(D z) {
    double _Complex w; __real__ w = z.r; __imag__ w = z.i; return w; }
static float _Complex f(F z) {
    float _Complex w; __real__ w = z.r; __imag__ w = z.i; return w; }
static D dd(double _Complex w) { D z = { __real__ w, __imag__ w }; return z; }
static F ff(float _Complex w) { F z = { __real__ w, __imag__ w }; return z; }
D my_cpow(D a, D b) { return dd(cpow(d(a), d(b))); }
F my_cpowf(F a, F b) { return ff(cpowf(f(a), f(b))); }
"""
TO_COMPLEX = (
    "cacos cacosh casin casinh catan catanh ccos ccosh cexp clog conj cproj csin csinh "
    "csqrt ctan ctanh"
).split()
TO_REAL = "cabs carg cimag creal".split()


def complex_functions() -> str:
    """Write the complex functions, of which structures are taken and returned."""
    lines = [COMPLEX]
    for name in TO_COMPLEX:
        lines.append(f"D my_{name}(D z) {{ return dd({name}(d(z))); }}")
        lines.append(f"F my_{name}f(F z) {{ return ff({name}f(f(z))); }}")
    for name in TO_REAL:
        lines.append(f"double my_{name}(D z) {{ return {name}(d(z)); }}")
        lines.append(f"float my_{name}f(F z) {{ return {name}f(f(z)); }}")
    return "\n".join([*lines, ""])


def forward(library: str, names: Iterable[str], to: str, own: Iterable[str]) -> str:
    """Write a definition file: names are another library's, but for those of its own.

    Args:
        library: File name of the library that is made.
        names: What it exports.
        to: Library that has them, without its suffix.
        own: What it has itself, by functions that begin with `my_`.
    """
    made = set(own)
    every = dict.fromkeys([*names, *sorted(made)])
    rows = (f"{n} = my_{n}" if n in made else f"{n} = {to}.{n}" for n in every)
    return "\n".join([f"LIBRARY {library}", "EXPORTS", *rows, ""])


def main() -> None:
    """Write sources and definition files."""
    folder, python, runtime = map(Path, sys.argv[1:])
    own = [n + kind for n in [*TO_COMPLEX, *TO_REAL, "cpow"] for kind in ("", "f")]
    abi = [n for n in python.read_text().split() if n.startswith(("Py", "_Py"))]
    texts = {
        "bcryptprimitives.c": RANDOM,
        "python3.c": "",
        "python3.def": forward("python3.dll", abi, "python311", ()),
        "ucrtbase.c": complex_functions(),
        "ucrtbase.def": forward(
            "ucrtbase.dll", runtime.read_text().split(), "winecrt", own
        ),
    }
    for name, text in texts.items():
        (folder / name).write_text(text)


if __name__ == "__main__":
    main()
