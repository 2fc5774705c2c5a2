"""Caches: damaged, truncated, foreign, unwritable and concurrent ones cost time, never a result; none is
loaded from a folder that others can write."""

import itertools
import multiprocessing
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest

from mbref.kernels import checked_file, disk_cache, safe_folder
from mbref.simulation.simulate import simulate

ROOT = Path(__file__).parents[3]
SMALL_KERNEL = """
import sys
sys.path.insert(0, {root!r})
from numba import f8
from mbref.kernels.compilation import CACHE, entry, kernel

@kernel
def twice(x):
    return 2.0 * x

@entry(f8(f8))
def shifted(x):
    return twice(x) + 1.0

print(shifted(3.0))
"""
SCENE = """
import sys
sys.path.insert(0, {root!r})
from pathlib import Path
from mbref.kernels.machine_code import code_at

THREE_TIMES = '''
define double @three_times(double %x) {{
  %product = fmul double %x, 3.0
  ret double %product
}}
'''
code = code_at(Path(sys.argv[1]) / "scene.code", lambda: THREE_TIMES)
print(code.address("three_times") != 0)
"""
USERS = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs users of POSIX")


def test_file_is_read_as_it_was_written_and_nothing_else_is_left(tmp_path: Path):
    """A file that was not written, b, is read as None."""
    checked_file.write(tmp_path / "new" / "a", b"data")
    assert checked_file.read(tmp_path / "new" / "a") == b"data"
    assert checked_file.read(tmp_path / "b") is None
    assert os.listdir(tmp_path / "new") == ["a"]


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[:-1],
        lambda data: data[:10],
        lambda data: b"",
        lambda data: data + b"x",
        lambda data: data[:40] + bytes([data[40] ^ 1]) + data[41:],
        lambda data: b"something else",
    ],
    ids=["a byte less", "cut to 10 bytes", "empty", "a byte more", "a bit flipped", "other text"],
)
def test_damaged_file_is_reported_removed_and_not_read(damage, tmp_path: Path, capsys):
    """A file has a checksum of its data, here 50 bytes; some of its bytes are changed, missing or new."""
    path = tmp_path / "a"
    checked_file.write(path, b"data " * 10)
    path.write_bytes(damage(path.read_bytes()))
    assert checked_file.read(path) is None
    assert capsys.readouterr().err == f"mbref: {path} is damaged and will be written again\n"
    assert not path.exists()


def test_unwritable_folder_is_reported_once(tmp_path: Path, capsys):
    """A file is in the folder's place, and two files cannot be written into it."""
    (tmp_path / "file").write_text("no folder")
    for name in "ab":
        checked_file.write(tmp_path / "file" / name, b"data")
        assert checked_file.read(tmp_path / "file" / name) is None
    error = capsys.readouterr().err
    assert error.count("cannot write to") == 1, error


def test_folder_in_place_of_a_file_is_reported(tmp_path: Path, capsys):
    """A folder has the path of a file of the cache: None is read, and the reason is printed."""
    (tmp_path / "a").mkdir()
    assert checked_file.read(tmp_path / "a") is None
    assert "cannot be read (Is a directory)" in capsys.readouterr().err


def test_writers_at_the_same_time_leave_one_whole_file(tmp_path: Path):
    """Fifty threads write files of different sizes to one path."""
    path, sizes = tmp_path / "a", range(1000, 200_000, 4000)
    writers = [threading.Thread(target=checked_file.write, args=(path, b"x" * size)) for size in sizes]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert len(checked_file.read(path)) in sizes
    assert os.listdir(tmp_path) == ["a"]


def forked(work: Callable[[], None]) -> BaseProcess:
    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    return process


def test_a_killed_writer_leaves_a_whole_file(tmp_path: Path, capfd):
    """A megabyte of one digit is written again and again; after each of five kills it has one digit only."""
    path = tmp_path / "a"
    checked_file.write(path, b"0" * 1_000_000)

    def write() -> None:
        for digit in itertools.cycle(b"123456789"):
            checked_file.write(path, bytes([digit]) * 1_000_000)

    for _ in range(5):
        before, process = path.stat().st_ino, forked(write)
        while path.stat().st_ino == before:  # nothing has been written yet
            assert process.is_alive()
        process.kill()
        process.join()
        assert len(set(checked_file.read(path))) == 1
    assert capfd.readouterr().err == ""


def compiling(cache: Path) -> dict[str, str]:
    """Return the environment of a process that compiles, and has its cache in a folder."""
    return {k: v for k, v in os.environ.items() if k != "NUMBA_DISABLE_JIT"} | {"NUMBA_CACHE_DIR": str(cache)}


def ran(script: str, folder: Path, cache: Path) -> tuple[str, str]:
    """Return the output and errors of a program that ends with status 0 and has its cache in a folder."""
    file = folder / "program.py"
    if not file.exists():
        file.write_text(script.format(root=str(ROOT)))
    command = [sys.executable, str(file), str(cache)]
    done = subprocess.run(command, env=compiling(cache), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done
    return done.stdout, done.stderr


# each damage costs several new processes that compile
DAMAGES = (
    pytest.param(lambda data: data[: len(data) // 2], id="cut in half"),
    pytest.param(lambda data: b"\0" * len(data), id="zeros", marks=pytest.mark.slow),
)


@pytest.mark.parametrize(
    ("script", "pattern", "says"),
    [
        pytest.param(SMALL_KERNEL, "*.nbc", "7.0\n", id="code of a kernel"),
        pytest.param(SMALL_KERNEL, "*.nbi", "7.0\n", id="index of a kernel", marks=pytest.mark.slow),
        pytest.param(SCENE, "*.code", "True\n", id="code of a scene"),
    ],
)
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_machine_code_is_reported_compiled_again_and_stored(script, pattern, says, damage, tmp_path):
    """Three processes: the first compiles, the second finds files damaged, the third finds them whole."""
    cache = tmp_path / "cache"
    assert ran(script, tmp_path, cache)[0] == says
    files = sorted(cache.rglob(pattern))
    assert files
    good = {file: file.read_bytes() for file in files}
    for file in files:
        file.write_bytes(damage(good[file]))
    out, error = ran(script, tmp_path, cache)
    assert out == says and "is damaged and will be written again" in error and "Traceback" not in error, error
    assert sorted(cache.rglob(pattern)) == files
    out, error = ran(script, tmp_path, cache)
    assert (out, "damaged" in error) == (says, False), error


def kernel_of(cache: Path) -> Path:
    """Return a new file in a folder of a cache, named as numba names the code of the function ``forked``."""
    file = cache / f"{Path(__file__).parent.name}_1" / f"{Path(__file__).stem}.forked-1.nbc"
    file.parent.mkdir(parents=True)
    file.write_bytes(b"machine code")
    return file


@pytest.mark.parametrize("ahead", [-1e8, 5.0, 1e8])  # s: three years, or clocks that differ a little
def test_damaged_code_of_a_kernel_is_removed_whatever_the_time_of_its_file(ahead, tmp_path: Path, capsys):
    """Damage is found by a checksum: the file with the recorded bytes stays, and the one with other bytes
    goes, though both have the same time, which is ``ahead`` of now."""
    disk_cache.begin(tmp_path)
    file = kernel_of(tmp_path)
    disk_cache.record_files(tmp_path)
    then = time.time() + ahead
    for content, stays in ((b"machine code", True), (b"another code", False)):
        file.write_bytes(content)
        os.utime(file, (then, then))
        disk_cache.remove_damaged(tmp_path, forked)
        assert file.exists() == stays
    assert capsys.readouterr().err == f"mbref: {file} is damaged and will be written again\n"


@USERS
@pytest.mark.parametrize("place", ["root", "version", "kernels"])
def test_kernels_are_not_used_from_a_cache_in_which_others_can_write(place, tmp_path: Path, capsys):
    """One of the cache's three levels of folders has the mode 0777; other users can reach all of them."""
    version = tmp_path / "cache" / "version"
    levels = {"root": version.parent, "version": version, "kernels": kernel_of(version).parent}
    for folder in (tmp_path, *levels.values()):
        folder.chmod(0o755)
    levels[place].chmod(0o777)
    assert not disk_cache.is_writable(version)
    assert f"{levels[place]} can be written by other users (chmod go-w" in capsys.readouterr().err


@USERS
def test_folders_of_a_new_cache_have_mode_0700_whatever_the_umask(tmp_path: Path):
    """The umask 0 would give 0777."""
    before = os.umask(0)
    try:
        safe_folder.make(tmp_path / "cache" / "version")
    finally:
        os.umask(before)
    made = (tmp_path / "cache", tmp_path / "cache" / "version")
    assert [folder.stat().st_mode & 0o777 for folder in made] == [0o700, 0o700]


@USERS
def test_no_data_are_written_to_or_read_from_a_folder_that_others_can_write(tmp_path: Path, capsys):
    """The folder has the mode 0777. A folder of mode 0700 beside it is used, and one warning is printed."""
    ours, open_to_all = tmp_path / "cache" / "ours", tmp_path / "cache" / "open"
    checked_file.write(ours / "data", b"stored")
    for folder in (tmp_path, ours.parent):  # which others can reach
        folder.chmod(0o755)
    open_to_all.mkdir()
    open_to_all.chmod(0o777)
    checked_file.write(open_to_all / "data", b"refused")
    assert checked_file.read(ours / "data") == b"stored"
    assert not (open_to_all / "data").exists() and checked_file.read(open_to_all / "data") is None
    assert capsys.readouterr().err.count("can be written by other users") == 1


@pytest.mark.parametrize(
    ("script", "says"), [(SMALL_KERNEL, "7.0\n"), (SCENE, "True\n")], ids=["kernel", "scene"]
)
def test_program_runs_without_a_writable_cache(script, says, tmp_path: Path):
    """A file is in place of the cache's folder."""
    (tmp_path / "file").write_text("no folder")
    out, error = ran(script, tmp_path, tmp_path / "file")
    assert out == says and "cannot write to" in error and "Traceback" not in error, error


@pytest.mark.parametrize("program", ["mbref", "crosscheck"])
def test_printing_help_creates_no_cache(program, tmp_path: Path):
    """NUMBA_CACHE_DIR names a folder that is not there before, nor after."""
    command = [sys.executable, "-m", program, "--help"]
    subprocess.run(command, env=compiling(tmp_path / "cache"), cwd=ROOT, capture_output=True, check=True)
    assert not (tmp_path / "cache").exists()


def test_second_run_of_a_scene_imports_neither_scipy_sparse_nor_scipy_integrate():
    """The program prints which of both modules a new process has loaded after its run."""
    simulate("four_bar_gravity", times=[0.01])  # writes the caches
    code = "import sys, mbref; mbref.simulate('four_bar_gravity', times=[0.01])\n"
    code += "print(*{'scipy.' + name for name in ('sparse', 'integrate')} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
