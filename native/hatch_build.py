"""Builds the native core with the package: one library for every Python from 3.11."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LIBRARY = "postproc/_native.abi3.so"


class CoreBuildHook(BuildHookInterface):
    """Runs cargo, puts the library where Python finds it, names the wheel after it."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the core: into the sources of an editable install, else into the wheel.

        Args:
            version: What is built: ``editable`` or ``standard``.
            build_data: What hatchling makes the wheel from.
        """
        built = build(Path(self.root) / "native")
        if version == "editable":
            replace(built, Path(self.root) / LIBRARY)
        else:
            build_data["force_include"][str(built)] = LIBRARY
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{platform}"


def build(folder: Path) -> Path:
    """Compile the core; return the library. Ends the build where that cannot be."""
    cargo = shutil.which("cargo") or shutil.which(
        "cargo", path=Path.home() / ".cargo/bin"
    )
    if cargo is None:
        print((folder / "no-cargo.txt").read_text("utf-8"), file=sys.stderr)
        raise SystemExit(2)
    target = Path(os.environ.get("CARGO_TARGET_DIR", folder / "target")).absolute()
    command = [cargo, "build", "--release", "--locked", "--quiet"]
    command += ["--target-dir", str(target)]
    python = {"PYO3_PYTHON": sys.executable}
    done = subprocess.run(command, cwd=folder, env=os.environ | python, check=False)
    if done.returncode:
        print("postproc: cargo could not build the core, see above", file=sys.stderr)
        raise SystemExit(2)
    return target / "release" / "libpostproc_native.so"


def replace(built: Path, library: Path) -> None:
    """Put a library in place at once: a process that uses the old one keeps it."""
    new = library.with_suffix(".new")
    shutil.copy(built, new)
    os.replace(new, library)
