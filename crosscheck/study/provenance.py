"""Origin of a record: versions of packages, commit of the code, date and machine."""

from __future__ import annotations

import functools
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import mbref

PACKAGES = ("numpy", "scipy", "numba")


def made_by() -> dict[str, Any]:
    """Return the origin of a record: versions, commit, date (UTC) and machine."""
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return {"versions": versions(), "commit": commit(), "date": date, "machine": machine()}


@functools.cache
def commit() -> str | None:
    """Return the commit of the checkout that contains this code, with ``+`` after changes; None outside a
    checkout."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None
    reported = [_git(root, "rev-parse", "--short=12", "HEAD"), _git(root, "status", "--porcelain", "-uno")]
    return None if reported[0] is None else reported[0] + ("+" if reported[1] else "")


def _git(root: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


@functools.cache
def versions() -> dict[str, str | None]:
    """Return the versions of Python and of the packages on which results depend; None for missing
    packages."""
    installed = {name: _installed(name) for name in PACKAGES}
    return {"python": platform.python_version(), "mbref": mbref.__version__, **installed}


def _installed(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


@functools.cache
def machine() -> dict[str, str | int | None]:
    """Return a description of the machine: processor, number of cores and operating system."""
    return {"cpu": _processor(), "cores": os.cpu_count(), "system": platform.platform()}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()
