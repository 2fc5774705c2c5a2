"""Our C functions around Pinocchio, compiled once from ``rates.cpp`` against the headers of its wheel.

The library is kept in the user's cache folder for its source, compiler's command and Pinocchio's version.
It needs a C++ compiler and Eigen's headers (package ``cmeel-eigen``).
"""

from __future__ import annotations

import ctypes
import functools
import os
import shutil
import subprocess
from pathlib import Path

from crosscheck.engines import kept

FOLDER = "pinocchio"  # of the cache
SOURCE = Path(__file__).with_name("rates.cpp")
COMPILERS = ("c++", "g++", "clang++")
FLAGS = (
    "-std=c++17", "-O2", "-DNDEBUG", "-shared", "-fPIC", "-Wno-deprecated-declarations",
    "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION", "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
)  # fmt: skip
EIGEN = Path("/usr/include/eigen3")  # of the system, beside that of the prefix
TIME_LIMIT = 500.0  # s of compiling; half a minute is usual


class NoLibrary(Exception):
    """The sentence says why there is none."""


def why_not() -> str:
    """Why the library cannot be compiled here, in a sentence; empty where nothing is missing."""
    try:
        _command(Path("library"))
    except NoLibrary as reason:
        return str(reason)
    return ""


@functools.cache
def library() -> ctypes.CDLL:
    """The library, compiled where it is not in the cache; raises NoLibrary."""
    path = _kept() or _compiled()
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise NoLibrary(f"the compiled library cannot be loaded: {error}") from error


def _prefix() -> Path:
    """The folder with Pinocchio's ``include`` and ``lib``."""
    import pinocchio

    for folder in Path(pinocchio.__file__).parents:
        if (folder / "include" / "pinocchio").is_dir():
            return folder
    raise NoLibrary("the headers of Pinocchio are not installed beside its Python package")


def _eigen(prefix: Path) -> Path:
    for folder in (prefix / "include" / "eigen3", EIGEN):
        if (folder / "Eigen").is_dir():
            return folder
    raise NoLibrary("the headers of Eigen are not installed (package cmeel-eigen)")


def _compiler() -> str:
    names = (os.environ["CXX"],) if os.environ.get("CXX") else COMPILERS
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        raise NoLibrary(f"no C++ compiler is installed ({', '.join(names)})")
    return found


def _command(target: Path) -> list[str]:
    """The compiler's command line; raises NoLibrary where something is missing."""
    compiler, prefix = _compiler(), _prefix()
    headers = [f"-isystem{folder}" for folder in (prefix / "include", _eigen(prefix))]
    linked = [path for path in (prefix / "lib").glob("libpinocchio_default.*") if path.is_file()]
    if not linked:
        raise NoLibrary("the library of Pinocchio is not installed beside its headers")
    link = [str(linked[0]), f"-Wl,-rpath,{prefix / 'lib'}"]
    return [compiler, *FLAGS, *headers, str(SOURCE), "-o", str(target), *link]


@functools.cache
def _origin() -> str:
    """Hash of Pinocchio's version, the compiler's command and the source."""
    import pinocchio

    return kept.hashed(pinocchio.__version__, *_command(Path("library")), SOURCE.read_text())


def _kept() -> Path | None:
    """The library in the cache."""
    return kept.kept(FOLDER, _origin(), ".so")


def _compiled() -> Path:
    """Compiles the library and puts it into the cache."""
    return kept.keep(FOLDER, _origin(), ".so", _compile)


def _compile(target: Path) -> None:
    command = _command(target)
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIME_LIMIT)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoLibrary(f"the C++ compiler could not be run: {error}") from error
    if done.returncode != 0:
        said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
        raise NoLibrary(f"the C++ compiler failed: {said}")
