"""Trees of small programs, for the tests of batch, cluster and check."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

ARM_AT = "  MOVE JOINT TO {0, 0, -90, 0, 60, 0}\r\n"


def program(name: str, targets: int, seed: int) -> bytes:
    """Write a drilling program in the cell's user frame, approached from both sides."""
    rng = np.random.default_rng(seed)
    lines = [f"PROGRAM {name} NOHOLD\r\n", "VAR\r\n", "BEGIN\r\n", ARM_AT]
    at = np.array([100.0, 100.0, 250.0])
    for _ in range(targets):
        at = np.clip(at + rng.uniform(-60.0, 60.0, 3), [0, 0, 100], [300, 400, 400])
        numbers = ", ".join(f"{v:.3f}" for v in (*at, 0.0, 180.0, 0.0))
        lines.append(f"  MOVE LINEAR TO POS({numbers}, '')\r\n")
    return "".join([*lines, f"END {name}\r\n"]).encode("ascii")


def grow(root: Path, programs: int, targets: int, seed: int = 1) -> Path:
    """Write a tree: programs in folders of ten, and other files between them."""
    for i in range(programs):
        folder = root / f"line{i // 10:03d}"
        folder.mkdir(parents=True, exist_ok=True)
        name = f"job{i:05d}"
        (folder / f"{name}.pdl").write_bytes(program(name, targets, seed + i))
        if i % 10 == 0:
            (folder / "notes.txt").write_bytes(f"folder {i}\r\n".encode())
    return root


def pages(folder: Path, count: int, targets: int, seed: int = 1) -> Path:
    """Write a job of several pages, each a routine that the main program calls."""
    names = [f"page{i + 1}" for i in range(count)]
    imports = "".join(f"IMPORT '{n}'\r\n" for n in names)
    heads = "".join(f"ROUTINE r_{n} EXPORTED FROM {n}\r\n" for n in names)
    calls = "".join(f"  r_{n}\r\n" for n in names)
    main = (
        f"PROGRAM main NOHOLD\r\n{imports}{heads}BEGIN\r\n{ARM_AT}{calls}END main\r\n"
    )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "main.pdl").write_bytes(main.encode())
    for i, name in enumerate(names):
        moves = program(name, targets, seed + i).decode().split(ARM_AT)[1]
        moves = moves.rpartition("END")[0]
        text = (
            f"PROGRAM {name}\r\nROUTINE r_{name} EXPORTED FROM {name} GLOBAL\r\n"
            f"ROUTINE r_{name}\r\nBEGIN\r\n{moves}END r_{name}\r\n"
            f"BEGIN\r\nEND {name}\r\n"
        )
        (folder / f"{name}.pdl").write_bytes(text.encode())
    return folder


def contents(root: Path) -> dict[str, str]:
    """Hash every file of a tree, by its path below it."""
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(root.rglob("*"))
        if path.is_file()
    }
