"""Compilation, caches and locks of kernels, step by step / files, texts and calls worked out by hand."""

from __future__ import annotations

import contextlib
import errno
import gc
import hashlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import llvmlite.binding as llvm
import numba
import pytest
from numba import f8, i8, types, u4

from mbref.kernels import (
    background,
    checked_file,
    compilation,
    disk_cache,
    file_lock,
    interrupts,
    layout,
    machine_code,
    scene_layout,
)
from mbref.kernels.compilation import FLOAT, INT, Entry, Exchangeable, Helper
from mbref.taylor import layout as taylor_layout


# --- names and options ------------------------------------------------------------------------------------
def test_kinds_of_arrays_and_options_of_compilation():
    kinds = (compilation.VECTOR, compilation.MATRIX, compilation.INDICES, compilation.UNSIGNED)
    found = [(kind.dtype, kind.ndim, kind.layout) for kind in (*kinds, compilation.INDEX_TABLE)]
    assert found == [(f8, 1, "C"), (f8, 2, "C"), (i8, 1, "C"), (u4, 1, "C"), (i8, 2, "C")]
    assert compilation.OPTIONS == {"cache": True, "error_model": "numpy", "_nrt": False}
    assert compilation.NO_WRAPPERS == {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    assert compilation.pair_of(f8, i8) == types.Tuple((f8, i8))


def test_signatures_of_kernels_that_are_passed_on():
    vector, memory, system = compilation.VECTOR, layout.MEMORY, layout.SYSTEM
    rates = types.FunctionType(layout.RATES)
    wanted = {
        "ACCELERATE": (i8, (system,)),
        "ENTER": (i8, (f8, vector, memory)),
        "RATES": (i8, (f8, vector, vector, memory)),
        "ACCEPT": (i8, (f8, vector, memory)),
        "STEP": (f8, (rates, f8, f8, vector, vector, vector, memory)),
        "PROPOSE": (f8, (f8, f8, f8, vector, vector, memory)),
    }
    for name, (result, arguments) in wanted.items():
        signature = getattr(layout, name)
        assert (signature.return_type, signature.args) == (result, arguments), name


def test_signatures_of_kernels_of_series():
    """Kernels that choose rows have no arguments but the memory; others have times, pivots or variables."""
    matrix, memory = compilation.MATRIX, taylor_layout.SERIES
    alone = (
        "BEGIN TAKE_STEP PARTITION RESPOND TERMS CORRECT SAMPLE SAVE_SERIES RETURN_TO_START RECORD_CROSSINGS"
    )
    wanted = {
        **dict.fromkeys(alone.split(), (i8, (memory,))),
        "JUDGE_START": (i8, (i8, memory)),
        "TURNING_PIVOT": (f8, (f8, memory)),
        "DETECT": (i8, (f8, f8, memory)),
        "EXPAND": (i8, (f8, memory)),
        "BALANCE": (i8, (f8, memory)),
        "GRADIENT": (i8, (matrix, memory)),
        "DETERMINANT": (types.Tuple((types.boolean, f8)), (matrix, memory)),
    }
    for name, (result, arguments) in wanted.items():
        signature = getattr(taylor_layout, name)
        assert (signature.return_type, signature.args) == (result, arguments), name


def test_first_numbers_of_a_run():
    settings = (0.0, 0.0, 1e-10, 1e-13, 1e-15, 0, 0)
    assert layout.Settings() == settings and layout.OperationCounts() == (0,) * 6
    assert layout.Watch() == (0.0, 0.0, 1.0, 0.0, 0, 0, 0.0, 0.0)
    assert layout.Clock() == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0, 0, 0, 0.0, -1)
    statuses = (layout.OK, layout.SINGULAR, layout.NOT_CONVERGED, layout.NOT_FINITE)
    assert (*statuses, layout.CHANGED, layout.SINGULAR_AHEAD) == (0, 1, 2, 3, 4, 5)


def test_numbers_in_which_scenes_of_one_structure_differ():
    def made(schema: Any, first: int) -> Any:
        return schema(*range(first, first + len(schema._fields)))

    primitives, functions, loads = (
        made(schema, first)
        for schema, first in (
            (scene_layout.Primitives, 100),
            (scene_layout.Functions, 200),
            (scene_layout.Loads, 300),
        )
    )
    data = scene_layout.SceneData(1, 2, 3, made(scene_layout.Bodies, 10), primitives, 4, functions, loads)  # type: ignore[arg-type]
    assert data.numbers == (1, 2, 3, 10, 11, *range(109, 115), *range(201, 208), *range(305, 315))


# --- the folder of compiled kernels -----------------------------------------------------------------------
def test_the_hash_of_the_sources_with_kernels(tmp_path, monkeypatch):
    """Numba's version, then the files of the folders in their order; other folders do not count."""
    for name, text in (("b/2.py", "two"), ("b/deep/1.py", "one"), ("a/3.py", "three"), ("c/4.py", "four")):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "b" / "2.txt").write_text("no source")
    monkeypatch.setattr(compilation.mbref, "__file__", str(tmp_path / "__init__.py"))
    monkeypatch.setattr(compilation, "WITH_KERNELS", ("b", "a"))
    wanted = hashlib.sha256((numba.__version__ + "twoonethree").encode()).hexdigest()
    assert compilation._source_hash() == wanted[:16]


@pytest.mark.parametrize(
    ("variables", "folder"),
    [
        ({"NUMBA_CACHE_DIR": "/n", "XDG_CACHE_HOME": "/x"}, "/n"),
        ({"NUMBA_CACHE_DIR": "/n"}, "/n"),
        ({"XDG_CACHE_HOME": "/x"}, "/x/mbref"),
        ({}, "/home/.cache/mbref"),
        ({"NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": ""}, "/home/.cache/mbref"),
    ],
)
def test_the_folder_of_the_cache(monkeypatch, variables, folder):
    monkeypatch.setattr(os, "environ", variables)
    monkeypatch.setattr(Path, "home", lambda: Path("/home"))
    assert compilation._cache_root() == Path(folder)


# --- decorators -------------------------------------------------------------------------------------------
def f(x: float) -> float:
    """Return 2 x."""
    return 2 * x


@pytest.mark.parametrize(
    ("decorator", "options"),
    [
        (compilation.kernel, {}),
        (compilation.inlined, {"forceinline": True}),
        (compilation.allocating, {"_nrt": True}),
    ],
)
def test_helpers_and_their_options(monkeypatch, decorator, options):
    monkeypatch.setattr(compilation, "PLAIN", True)
    assert decorator(f) is f
    monkeypatch.setattr(compilation, "PLAIN", False)
    made = decorator(f)
    assert isinstance(made, Helper) and made.function is f
    assert made._options == {"cache": False, "error_model": "numpy", "_nrt": False, **options}
    assert (made.__name__, made.__doc__, made.__wrapped__) == ("f", "Return 2 x.", f)


def test_dispatchers_are_made_when_they_are_needed(monkeypatch):
    asked: list[Any] = []

    def njit(**options: Any) -> Any:
        asked.append(options)
        return lambda function: lambda *given: (function(*given), len(asked))

    monkeypatch.setattr(compilation, "njit", njit)
    made = Helper(f, {"cache": False})
    assert not asked and made(3.0) == (6.0, 1) and made(4.0) == (8.0, 1)
    assert made._called is made._called
    assert asked == [{"cache": False}, {"cache": False, **compilation.NO_WRAPPERS}]


def test_kernels_that_are_passed_on_have_signatures():
    passed, called = compilation.exchangeable(FLOAT(FLOAT))(f), compilation.entry(INT(FLOAT))(f)
    assert type(passed) is Exchangeable and type(called) is Entry
    assert (passed.function, passed.signature) == (f, FLOAT(FLOAT))
    assert (called.function, called.signature) == (f, INT(FLOAT))
    copy = passed.callable
    assert type(copy) is Entry and copy.signature == FLOAT(FLOAT) and copy.function(2.5) == 5.0
    names = copy.function.__name__, copy.function.__qualname__, copy.function.__module__
    assert names == ("f_entry", "f_entry", __name__)
    assert compilation.pointer_to(FLOAT(FLOAT)) == types.FunctionType(FLOAT(FLOAT))


@pytest.fixture
def compiling(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the calls of one compilation; the cache is writable, has the kernel, and loads it."""

    def compiled(writable: bool, kept: list[bool], loaded: bool) -> Any:
        calls: list[Any] = []

        @contextlib.contextmanager
        def held(path: Path) -> Iterator[None]:
            calls.append(("held", path.name))
            yield
            calls.append("released")

        class Made(Exchangeable):
            is_kept = property(lambda self: calls.append("kept?") or kept.pop(0))  # type: ignore[assignment]

            def _compile(self, **options: Any) -> Any:
                calls.append(("compiled", options))
                return "code"

            def _is_loaded(self, compiled: Any) -> bool:
                assert compiled == "code"
                return loaded

        monkeypatch.setattr(compilation, "PLAIN", False)
        monkeypatch.setattr(compilation, "CACHE", Path("/cache"))
        monkeypatch.setattr(compilation, "is_writable", lambda folder: writable and folder == Path("/cache"))
        monkeypatch.setattr(compilation, "held", held)
        for name in ("begin", "remove_damaged", "record_files", "_begin_compiling"):
            monkeypatch.setattr(compilation, name, lambda *given, name=name: calls.append((name, *given)))
        assert Made(f, FLOAT(FLOAT)).pointer == "code"
        return calls

    return compiled


CACHE = Path("/cache")
BEGUN = [("begin", CACHE), ("remove_damaged", CACHE, f), "kept?"]
LOCK = f"{__name__}.f"


def test_a_kernel_that_the_cache_has_is_loaded(compiling):
    assert compiling(True, [True, True], True) == [*BEGUN, "kept?", ("compiled", {})]


def test_a_kernel_that_the_cache_lacks_is_compiled_under_a_lock(compiling):
    assert compiling(True, [False, False], False) == [
        *BEGUN,
        ("held", LOCK),
        "kept?",
        ("_begin_compiling",),
        ("compiled", {}),
        ("record_files", CACHE),
        "released",
    ]


def test_a_kernel_that_another_process_has_compiled_meanwhile_is_loaded(compiling):
    assert compiling(True, [False, True], True) == [
        *BEGUN,
        ("held", LOCK),
        "kept?",
        ("compiled", {}),
        "released",
    ]


def test_a_file_of_an_older_numba_is_replaced(compiling):
    assert compiling(True, [True, True], False)[-1] == ("record_files", CACHE)


def test_without_a_place_nothing_is_stored(compiling):
    assert compiling(False, [], False) == [("_begin_compiling",), ("compiled", {"cache": False})]


def test_plain_kernels_are_python_functions(monkeypatch):
    monkeypatch.setattr(compilation, "PLAIN", True)
    made = Exchangeable(f, FLOAT(FLOAT))
    assert made.is_kept and made.pointer is f and Entry(f, FLOAT(FLOAT))(1.5) == 3.0


def test_options_of_numba_for_both_kinds_of_kernels(monkeypatch):
    """A function pointer by ``cfunc``, an entry by ``njit``; both inside of the cache's folder."""
    calls: list[Any] = []

    @contextlib.contextmanager
    def within(*given: Any) -> Iterator[None]:
        calls.append(given)
        yield

    def decorator(name: str) -> Any:
        return lambda signature, **options: lambda function: (name, signature, options, function)

    for name in ("cached_in", "interrupts_kept"):
        monkeypatch.setattr(compilation, name, within)
    for name in ("cfunc", "njit"):
        monkeypatch.setattr(compilation, name, decorator(name))
    signature = FLOAT(FLOAT)
    options = {"cache": False, "error_model": "numpy", "_nrt": False}
    assert Exchangeable(f, signature)._compile(cache=False) == ("cfunc", signature, options, f)
    assert Entry(f, signature)._compile() == ("njit", signature, compilation.OPTIONS, f)
    assert calls == [(compilation.CACHE,), ()] * 2
    for hits, loaded in ((1, True), (0, False)):
        assert Exchangeable(f, signature)._is_loaded(SimpleNamespace(cache_hits=hits)) is loaded
        stats = SimpleNamespace(cache_hits={"f": 1} if hits else {})
        assert Entry(f, signature)._is_loaded(SimpleNamespace(stats=stats)) is loaded


@pytest.mark.parametrize(
    ("names", "kept"), [(["f-1.nbi", "f-1.nbc"], True), (["f-1.nbi"], False), ([], False)]
)
def test_kernels_whose_code_the_cache_has(monkeypatch, names, kept):
    monkeypatch.setattr(compilation, "PLAIN", False)
    asked: list[Any] = []
    monkeypatch.setattr(compilation, "files_of", lambda *given: asked.append(given) or map(Path, names))
    assert Exchangeable(f, FLOAT(FLOAT)).is_kept is kept and asked == [(compilation.CACHE, f)]


def test_kernels_that_another_process_compiles_now(monkeypatch):
    made, asked = Exchangeable(f, FLOAT(FLOAT)), []
    for held in (True, False):
        monkeypatch.setattr(compilation, "is_held", lambda path, held=held: asked.append(path) or held)
        assert made.is_compiled_elsewhere is held
    assert asked == [compilation.CACHE / "locks" / LOCK] * 2
    vars(made)["pointer"] = f
    monkeypatch.setattr(compilation, "is_held", lambda path: True)
    assert not made.is_compiled_elsewhere


def test_the_first_compilation_is_told_once(monkeypatch, capsys):
    frozen: list[int] = []
    monkeypatch.setattr(gc, "freeze", lambda: frozen.append(1))
    compilation._begin_compiling.__wrapped__()
    printed = capsys.readouterr()
    assert printed.out == "" and frozen == [1]
    assert printed.err == "mbref: compiling kernels for this machine, once for each method; up to a minute\n"
    assert hasattr(compilation._begin_compiling, "cache_info")


# --- numba's cache ----------------------------------------------------------------------------------------
def test_numba_uses_the_folder_inside_of_a_block():
    before = numba.config.CACHE_DIR
    with pytest.raises(KeyError), disk_cache.cached_in(Path("/there")):
        assert numba.config.CACHE_DIR == "/there"
        raise KeyError
    assert before == numba.config.CACHE_DIR


@pytest.mark.parametrize(("free", "good"), [(2**27, True), (2**27 - 1, False)])
def test_a_disk_with_little_space_is_not_used(tmp_path, monkeypatch, capsys, free, good):
    monkeypatch.setattr(disk_cache.shutil, "disk_usage", lambda folder: SimpleNamespace(free=free))
    folder = tmp_path / "new" / "deep"
    for _ in range(2):
        assert disk_cache.is_writable.__wrapped__(folder) is good and folder.is_dir()
    line = f"mbref: cannot write to {folder} ({os.strerror(errno.ENOSPC)}); kernels are compiled each time\n"
    assert capsys.readouterr().err == ("" if good else 2 * line) and not list(folder.iterdir())


def test_a_file_in_place_of_the_folder(tmp_path, capsys):
    (tmp_path / "taken").write_text("")
    assert disk_cache.is_writable.__wrapped__(tmp_path / "taken" / "deep") is False
    assert f"cannot write to {tmp_path / 'taken' / 'deep'}" in capsys.readouterr().err


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    """A cache with files of two functions, of which one has a local name; times are 100 s and 200 s."""
    names = {
        "mbref_1/test_kernel_files_by_hand.f-7.py311.nbi": 100,
        "mbref_1/test_kernel_files_by_hand.f-7.py311.1.nbc": 200,
        "mbref_1/test_kernel_files_by_hand.f-7.py311.tmp": 200,
        "mbref_1/test_kernel_files_by_hand.ff-7.py311.nbi": 100,
        "other/test_kernel_files_by_hand.f-7.py311.nbi": 200,
    }
    for name, time in names.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(name)
        os.utime(path, (time, time))
    (tmp_path / "plain file").write_text("")
    return tmp_path


def sum_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_files_of_a_function(stored):
    name = Path(f.__code__.co_filename).parent.name
    (stored / "mbref_1").rename(stored / f"{name}_1")
    found = sorted(disk_cache.files_of(stored, f))
    stem = stored / f"{name}_1"
    assert found == [stem / f"test_kernel_files_by_hand.f-7.py311.{end}" for end in ("1.nbc", "nbi")]
    assert disk_cache.files_of(stored / "absent", f) == []

    def inner() -> None:
        pass

    end = "test_kernel_files_by_hand.test_files_of_a_function.locals.inner-3.nbc"
    (stem / end).write_text("")
    assert disk_cache.files_of(stored, inner) == [stem / end]


def test_checksums_of_new_files_are_recorded(stored, monkeypatch):
    """Files of 200 s, by their folders' names, behind the lines that the list has."""
    (stored / disk_cache.CHECKSUMS).write_text("old line\n")
    monkeypatch.setattr(disk_cache, "begin", lambda folder: 200)
    disk_cache.record_files(stored)
    lines = (stored / disk_cache.CHECKSUMS).read_text().splitlines()
    new = [
        f"{sum_of(stored / name)} {name}"
        for name in (
            "mbref_1/test_kernel_files_by_hand.f-7.py311.1.nbc",
            "other/test_kernel_files_by_hand.f-7.py311.nbi",
        )
    ]
    assert lines[0] == "old line" and sorted(lines[1:]) == sorted(new)
    for name in (line.partition(" ")[2] for line in new):
        assert disk_cache._known(stored, stored / name) == {sum_of(stored / name)}
    assert disk_cache._known(stored, stored / "mbref_1" / "absent") == set()
    assert disk_cache._known(stored / "gone", stored / "x") == set()


def test_a_file_may_have_two_checksums(tmp_path):
    (tmp_path / disk_cache.CHECKSUMS).write_text(f"{'a' * 64} d/x.nbi\n{'b' * 64} d/x.nbi\n{'c' * 64} d/y\n")
    size = (tmp_path / disk_cache.CHECKSUMS).stat().st_size
    assert disk_cache._checksums(tmp_path, size) == {"d/x.nbi": {"a" * 64, "b" * 64}, "d/y": {"c" * 64}}


@pytest.mark.parametrize(
    ("known", "left", "told"),
    [
        (("right", "right"), ["a", "b", "new"], []),
        (("right", "wrong"), ["new"], ["b"]),
        (("wrong", "right"), ["new"], ["a"]),
        (("right", None), ["new"], []),
        ((None, None), ["new"], []),
        (("both", "right"), ["a", "b", "new"], []),
    ],
)
def test_damaged_files_are_removed_with_all_of_their_function(
    tmp_path, monkeypatch, capsys, known, left, told
):
    """Files without a checksum are removed silently; a file written since the beginning stays."""
    paths = {name: tmp_path / name for name in ("a", "b", "new")}
    for name, path in paths.items():
        path.write_text(name)
        os.utime(path, (100, 200 if name == "new" else 199))
    of = dict(zip("ab", known, strict=True))

    def known_of(folder: Path, path: Path) -> set[str]:
        assert folder == tmp_path
        right = {sum_of(path)}
        return {"right": right, "wrong": {"no"}, "both": right | {"no"}, None: set()}[of[path.name]]

    monkeypatch.setattr(disk_cache, "begin", lambda folder: 200)
    monkeypatch.setattr(disk_cache, "files_of", lambda *given: [*paths.values()] * (given == (tmp_path, f)))
    monkeypatch.setattr(disk_cache, "_known", known_of)
    disk_cache.remove_damaged(tmp_path, f)
    assert sorted(path.name for path in tmp_path.iterdir()) == left
    lines = [f"mbref: {paths[name]} is damaged and will be written again" for name in told]
    assert capsys.readouterr().err.splitlines() == lines


def test_names_and_times_of_files_that_another_process_removed(stored):
    assert disk_cache._checksum(stored / "gone") == "" and disk_cache._time_of(stored / "gone") == 0.0
    assert disk_cache._names_in(stored / "plain file") == []
    (stored / disk_cache.CHECKSUMS).write_text("")
    assert sorted(path.name for path in disk_cache._folders(stored)) == ["mbref_1", "other", "plain file"]
    assert disk_cache.begin.__wrapped__(stored) > 1e9


# --- locks ------------------------------------------------------------------------------------------------
def test_locks_without_support_of_the_system(tmp_path, monkeypatch):
    path = tmp_path / "a" / "b"
    assert not file_lock.is_held(path) and not path.parent.exists()
    with file_lock.held(path):
        assert path.exists() and file_lock.is_held(path)
    assert not file_lock.is_held(path)

    def refuse(*_: Any) -> None:
        raise OSError

    monkeypatch.setattr(file_lock.fcntl, "flock", refuse)
    with file_lock.held(path):
        assert not file_lock.is_held(path)
    monkeypatch.setattr(file_lock, "fcntl", None)
    with file_lock.held(path):
        assert not file_lock.is_held(path)


# --- interrupts -------------------------------------------------------------------------------------------
def test_a_block_that_swallows_its_interrupt(monkeypatch):
    assert threading.current_thread() is threading.main_thread()
    with monkeypatch.context() as own:
        own.setattr(signal, "getsignal", lambda number: signal.default_int_handler)
        handlers: list[Any] = []
        own.setattr(signal, "signal", lambda number, handler: handlers.append((number, handler)))
        with interrupts.interrupts_kept():
            [(number, handler)] = handlers
            assert number == signal.SIGINT and handler is not signal.default_int_handler
        assert handlers[1:] == [(signal.SIGINT, signal.default_int_handler)]
        with pytest.raises(KeyboardInterrupt), interrupts.interrupts_kept():
            with contextlib.suppress(KeyboardInterrupt):
                handlers[-1][1](signal.SIGINT, None)
            assert handlers[-1][0] == signal.SIGINT
        own.setattr(signal, "getsignal", lambda number: None)
        with interrupts.interrupts_kept():
            assert len(handlers) == 4, "a handler of the program stays"


# --- files with a checksum --------------------------------------------------------------------------------
def test_a_file_is_written_by_another_name_first(tmp_path, monkeypatch):
    path, moved = tmp_path / "a" / "b" / "file", []
    replace = os.replace
    monkeypatch.setattr(os, "replace", lambda old, new: moved.append((old, new)) or replace(old, new))
    for data in (b"data", b""):
        checked_file.write(path, data)
        assert path.read_bytes() == hashlib.sha256(data).digest() + data and checked_file.read(path) == data
    assert [new for _, new in moved] == [path, path] and Path(moved[0][0]).parent == path.parent
    assert [each.name for each in path.parent.iterdir()] == ["file"]


def test_a_file_that_cannot_be_moved_is_removed(tmp_path, monkeypatch, capsys):
    def refuse(*_: Any) -> None:
        raise OSError(errno.EACCES, "no")

    monkeypatch.setattr(os, "replace", refuse)
    checked_file._report_once.cache_clear()
    for _ in range(2):
        checked_file.write(tmp_path / "file", b"data")
    assert not list(tmp_path.iterdir())
    line = f"mbref: cannot write to {tmp_path} (no); it is computed each time\n"
    assert capsys.readouterr().err == line


# --- a second process -------------------------------------------------------------------------------------
KEPT, MISSING = SimpleNamespace(is_kept=True), SimpleNamespace(is_kept=False)


@pytest.mark.parametrize(
    ("cores", "kernels", "starts"),
    [
        (2, [KEPT, MISSING], True),
        (3, [MISSING], True),
        (1, [MISSING], False),
        (None, [MISSING], False),
        (2, [KEPT, KEPT], False),
        (2, [], False),
    ],
)
def test_when_a_second_process_starts(monkeypatch, cores, kernels, starts):
    calls: list[Any] = []

    class Process:
        def __init__(self, command: list[str], **streams: Any) -> None:
            calls.append((command, streams))

        def __enter__(self) -> Process:
            return self

        def __exit__(self, *_: object) -> None:
            calls.append("closed")

        def wait(self) -> None:
            calls.append("waited")

        def kill(self) -> None:
            calls.append("killed")

    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    monkeypatch.setattr(subprocess, "Popen", Process)
    with background.compiled_in_background(kernels, "the.module", "work"):
        calls.append("block")
    if not starts:
        assert calls == ["block"]
        return
    program = background.PROGRAM.format(module="the.module", function="work")
    streams = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    assert calls == [([sys.executable, "-c", program], streams), "block", "waited", "killed", "closed"]


def test_a_process_waits_for_the_end_of_its_input_in_a_thread(monkeypatch):
    calls: list[Any] = []

    class Thread:
        def __init__(self, target: Any, daemon: bool) -> None:
            calls.append((target, daemon))

        def start(self) -> None:
            calls.append("started")

    monkeypatch.setattr(threading, "Thread", Thread)
    background.end_with_parent()
    assert calls == [(background._end_at_end_of_input, True), "started"]
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(read=lambda: calls.append("read")))
    monkeypatch.setattr(os, "_exit", calls.append)
    background._end_at_end_of_input()
    assert calls[2:] == ["read", 1]


# --- machine code -----------------------------------------------------------------------------------------
def test_code_is_made_for_this_processor(monkeypatch):
    asked: list[Any] = []
    target = SimpleNamespace(create_target_machine=lambda **options: asked.append(options))
    monkeypatch.setattr(machine_code, "_target", lambda: target)
    machine_code._target_machine()
    features = llvm.get_host_cpu_features().flatten()
    assert asked == [{"cpu": llvm.get_host_cpu_name(), "features": features, "opt": 2, "jit": True}]
    assert machine_code.processor() == f"{llvm.get_host_cpu_name()} {features}"


def test_llvm_is_prepared_before_its_target_is_found(monkeypatch):
    calls: list[Any] = []
    for name in ("initialize_native_target", "initialize_native_asmprinter"):
        monkeypatch.setattr(machine_code.llvm, name, lambda name=name: calls.append(name))
    target = SimpleNamespace(from_default_triple=lambda: calls.append("found") or "target")
    monkeypatch.setattr(machine_code.llvm, "Target", target)
    assert machine_code._target.__wrapped__() == "target"
    assert calls == ["initialize_native_target", "initialize_native_asmprinter", "found"]


@pytest.mark.parametrize("on_disk", [True, False])
def test_the_oldest_code_leaves_the_process(monkeypatch, on_disk):
    calls: list[Any] = []
    loaded: dict[Any, Any] = {k: k for k in range(machine_code.MOST_LOADED)}
    monkeypatch.setattr(machine_code, "_loaded", loaded)
    monkeypatch.setattr(machine_code, "Code", lambda data: ("code", data))
    read = lambda path: b"old" if on_disk else None  # noqa: E731
    monkeypatch.setattr(machine_code.checked_file, "read", read)
    monkeypatch.setattr(machine_code, "_compiled", lambda path, text: calls.append((path, text)) or b"new")
    path: Any = "path"
    found = machine_code.code_at(path, lambda: "text")
    assert found == ("code", b"old" if on_disk else b"new") and calls == [("path", "text")] * (not on_disk)
    assert len(loaded) == 64 and 0 not in loaded and loaded["path"] is found
    assert machine_code.code_at(path, lambda: "other") is found
