"""Machine code of scenes: LLVM IR compiled once, stored on disk and, once loaded, in this process."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import llvmlite.binding as llvm

from mbref.kernels import checked_file

MOST_LOADED = 64  # number of pieces of code that a process keeps loaded
_loaded: dict[Path, Code] = {}


class NoGeneratedCode(Exception):
    """A scene or method has no generated code; the message is the reason."""


class Code:
    """Object code in memory; ``address(name)`` of a function is valid while this object exists."""

    def __init__(self, data: bytes):
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target_machine())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(data))
        self._engine.finalize_object()
        self._addresses: dict[str, int] = {}

    def address(self, name: str) -> int:
        """Return the address of a function."""
        if name not in self._addresses:
            self._addresses[name] = self._engine.get_function_address(name)
        return self._addresses[name]


def code_at(path: Path, write: Callable[[], str]) -> Code:
    """Return the code of a path: loaded before, stored on disk, or compiled from the LLVM IR that ``write``
    returns."""
    if path not in _loaded:
        data = checked_file.read(path) or _compiled(path, write())
        if len(_loaded) >= MOST_LOADED:
            del _loaded[next(iter(_loaded))]
        _loaded[path] = Code(data)
    return _loaded[path]


def _compiled(path: Path, text: str) -> bytes:
    module = llvm.parse_assembly(text)
    module.verify()
    data = _target_machine().emit_object(module)
    checked_file.write(path, data)
    return data


@functools.cache
def processor() -> str:
    """Return the processor for which the code is made."""
    return f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


@functools.cache
def _target() -> llvm.Target:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple()


def _target_machine() -> llvm.TargetMachine:
    """Return a new target machine: an engine takes ownership of it."""
    return _target().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, jit=True
    )
