"""Our C functions around Pinocchio, compiled once from ``rates.cpp`` against the headers of its wheel.

The library lies in the user's cache folder, its name a hash of source, compiler's command and Pinocchio's
version, and a hash of its bytes, so that a damaged one is made anew.  It needs a C++ compiler and Eigen's
headers (package ``cmeel-eigen``).
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

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


def _folder() -> Path:
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "mbref" / "pinocchio"


@functools.cache
def _origin() -> str:
    """Hash of Pinocchio's version, the compiler's command and the source."""
    import pinocchio

    text = "\n".join((pinocchio.__version__, *_command(Path("library")), SOURCE.read_text()))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _kept() -> Path | None:
    """The library in the cache whose bytes are those of its name."""
    for path in sorted(_folder().glob(f"{_origin()}-*.so")):
        with contextlib.suppress(OSError):
            if path.stem.partition("-")[2] == hashlib.sha256(path.read_bytes()).hexdigest()[:32]:
                return path
    return None


def _compiled() -> Path:
    """Compiles the library and puts it, whole, into the cache; into a temporary folder where that fails."""
    folder = _folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkstemp(dir=folder)[1])
    except OSError:
        folder = Path(tempfile.mkdtemp())
        made = folder / "made"
    try:
        _compile(made)
        path = folder / f"{_origin()}-{hashlib.sha256(made.read_bytes()).hexdigest()[:32]}.so"
        os.replace(made, path)
    finally:
        made.unlink(missing_ok=True)
    return path


def _compile(target: Path) -> None:
    command = _command(target)
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIME_LIMIT)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoLibrary(f"the C++ compiler could not be run: {error}") from error
    if done.returncode != 0:
        said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
        raise NoLibrary(f"the C++ compiler failed: {said}")
