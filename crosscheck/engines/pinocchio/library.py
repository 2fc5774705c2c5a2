"""crosscheck's C++ functions that call Pinocchio, compiled once from ``rates.cpp`` with the headers of its
Python package.

The library is stored in the user's cache folder by source, compiler command and Pinocchio's version. It needs
a C++ compiler and Eigen's headers (package ``cmeel-eigen``).
"""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

from crosscheck.engines.shared import file_cache
from crosscheck.engines.shared.compiler import CXX, NoLibrary

FOLDER = "pinocchio"  # name of the folder in the cache
SOURCE = Path(__file__).with_name("rates.cpp")
FLAGS = (
    "-std=c++17",
    "-O2",
    "-DNDEBUG",
    "-shared",
    "-fPIC",
    "-Wno-deprecated-declarations",
    "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
)
EIGEN = Path("/usr/include/eigen3")  # system folder, searched after the folder of the Python environment


def why_not() -> str:
    """Return the reason why the library cannot be compiled here, in a sentence; empty if nothing is
    missing."""
    try:
        _command(Path("library"))
    except NoLibrary as reason:
        return str(reason)
    return ""


@functools.cache
def library() -> ctypes.CDLL:
    """Return the library, compiled if it is not in the cache; raises NoLibrary."""
    path = _kept() or _compiled()
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise NoLibrary(f"the compiled library cannot be loaded: {error}") from error


def _prefix() -> Path:
    """Return the folder with Pinocchio's ``include`` and ``lib``."""
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


def _command(target: Path) -> list[str]:
    """Return the compiler's command line; raises NoLibrary if something is missing."""
    compiler, prefix = CXX.path(), _prefix()
    headers = [f"-isystem{folder}" for folder in (prefix / "include", _eigen(prefix))]
    linked = [path for path in (prefix / "lib").glob("libpinocchio_default.*") if path.is_file()]
    if not linked:
        raise NoLibrary("the library of Pinocchio is not installed beside its headers")
    link = [str(linked[0]), f"-Wl,-rpath,{prefix / 'lib'}"]
    return [compiler, *FLAGS, *headers, str(SOURCE), "-o", str(target), *link]


@functools.cache
def _origin() -> str:
    """Return a hash of Pinocchio's version, the compiler command and the source."""
    import pinocchio

    return file_cache.hashed(pinocchio.__version__, *_command(Path("library")), SOURCE.read_text())


def _kept() -> Path | None:
    """Return the library in the cache."""
    return file_cache.stored(FOLDER, _origin(), ".so")


def _compiled() -> Path:
    """Compile the library and store it in the cache."""
    return file_cache.store(FOLDER, _origin(), ".so", _compile)


def _compile(target: Path) -> None:
    CXX.run(_command(target))
