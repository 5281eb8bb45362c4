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

# What cargo makes for a kind of system, and where Python finds it.
LIBRARIES = {
    "windows": ("postproc_native.dll", "postproc/_native.pyd"),
    "darwin": ("libpostproc_native.dylib", "postproc/_native.abi3.so"),
    "linux": ("libpostproc_native.so", "postproc/_native.abi3.so"),
}
WHEELS = {"x86_64-pc-windows-gnu": "win_amd64", "x86_64-pc-windows-msvc": "win_amd64"}


class CoreBuildHook(BuildHookInterface):
    """Runs cargo, puts the library where Python finds it, names the wheel after it."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the core: into the sources of an editable install, else into the wheel.

        Args:
            version: What is built: ``editable`` or ``standard``.
            build_data: What hatchling makes the wheel from.
        """
        target = os.environ.get("CARGO_BUILD_TARGET", "")
        name, place = library_of(target)
        built = build(Path(self.root) / "native", target) / name
        if version == "editable":
            replace(built, Path(self.root) / place)
        else:
            build_data["force_include"][str(built)] = place
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{platform_of(target)}"


def library_of(target: str) -> tuple[str, str]:
    """Return what cargo calls the core, and its place in the package.

    Args:
        target: Rust's name of another system that is built for, "" for this one.
    """
    here = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    kind = next((k for k in LIBRARIES if k in target), "linux") if target else here
    return LIBRARIES[kind]


def platform_of(target: str) -> str:
    """Return the platform of a wheel's name; ends the build for one not known."""
    if not target:
        return sysconfig.get_platform().replace("-", "_").replace(".", "_")
    if target not in WHEELS:
        known = ", ".join(WHEELS)
        print(f"postproc: no wheel is known for {target}: {known}", file=sys.stderr)
        raise SystemExit(2)
    return WHEELS[target]


def build(folder: Path, target: str = "") -> Path:
    """Compile the core; return its folder. Ends the build where that cannot be."""
    cargo = shutil.which("cargo") or shutil.which(
        "cargo", path=Path.home() / ".cargo/bin"
    )
    if cargo is None:
        print((folder / "no-cargo.txt").read_text("utf-8"), file=sys.stderr)
        raise SystemExit(2)
    place = Path(os.environ.get("CARGO_TARGET_DIR", folder / "target")).absolute()
    command = [cargo, "build", "--release", "--locked", "--quiet"]
    command += ["--target-dir", str(place)]
    python = {"PYO3_PYTHON": sys.executable}
    if target:
        python = {"PYO3_CROSS": "1", "PYO3_CROSS_PYTHON_VERSION": "3.11"}
    done = subprocess.run(command, cwd=folder, env=os.environ | python, check=False)
    if done.returncode:
        print("postproc: cargo could not build the core, see above", file=sys.stderr)
        raise SystemExit(2)
    return place / target / "release"


def replace(built: Path, library: Path) -> None:
    """Put a library in place at once: a process that uses the old one keeps it."""
    new = library.with_suffix(".new")
    shutil.copy(built, new)
    os.replace(new, library)
