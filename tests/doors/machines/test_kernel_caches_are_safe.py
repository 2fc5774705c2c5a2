"""Compiled kernels on disk: none is loaded from a folder that others can write, nor from a damaged file."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mbref.kernels import checked_file

RUN = """
import sys
from numba import f8
from mbref.kernels.compilation import entry

@entry(f8(f8))
def doubled(x):
    return 2.0 * x

print(doubled(3.0), doubled.pointer.stats.cache_hits.total())
"""
USERS = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs users of POSIX")


def run(folder: Path, cache: Path) -> tuple[str, str, str]:
    """Run a program that doubles 3.0 by a kernel; return its result, the kernels loaded, and its errors."""
    program = folder / "program.py"
    if not program.exists():  # numba compiles anew after a change of the file's time
        program.write_text(RUN)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    environment.pop("NUMBA_DISABLE_JIT", None)
    done = subprocess.run(
        [sys.executable, str(program)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done
    value, loaded = done.stdout.split()
    return value, loaded, done.stderr


@USERS
@pytest.mark.slow
@pytest.mark.parametrize("place", ["root", "versions", "kernels"])
def test_a_cache_that_others_can_write_is_not_loaded(place, tmp_path):
    """One of its three levels of folders has the mode 0777; with the old mode the kernel is loaded again."""
    cache = tmp_path / "cache"
    assert run(tmp_path, cache)[:2] == ("6.0", "0") and run(tmp_path, cache)[:2] == ("6.0", "1")
    (version,) = cache.iterdir()
    (kernels,) = {path.parent for path in cache.rglob("*.nbc")}
    chosen = {"root": cache, "versions": version, "kernels": kernels}[place]
    for folder in (tmp_path, cache, version):  # which others can reach
        folder.chmod(0o755)
    mode = chosen.stat().st_mode & 0o777
    chosen.chmod(0o777)
    value, loaded, errors = run(tmp_path, cache)
    assert (value, loaded) == ("6.0", "0")
    assert f"{chosen} can be written by other users (chmod go-w" in errors and "Traceback" not in errors
    chosen.chmod(mode)
    assert run(tmp_path, cache)[:2] == ("6.0", "1")


@USERS
@pytest.mark.slow
def test_folders_of_a_new_cache_have_mode_0700_whatever_the_umask(tmp_path):
    """The umask 0 would give 0777. The owner's next run loads the kernel without a warning."""
    cache, before = tmp_path / "cache", os.umask(0)
    try:
        run(tmp_path, cache)
        assert [path.stat().st_mode & 0o777 for path in (cache, *cache.iterdir())] == [0o700, 0o700], (
            "with its version"
        )
        assert run(tmp_path, cache)[1:] == ("1", ""), "the owner loads the kernel"
    finally:
        os.umask(before)


@pytest.mark.slow
@pytest.mark.parametrize("ahead", [5.0, 1e8])  # s: clocks that differ a little, or by three years
@pytest.mark.parametrize("pattern", ["*.nbc", "*.nbi"])  # numba's machine code and its index
def test_damaged_kernel_is_compiled_again_though_its_file_time_lies_ahead(pattern, ahead, tmp_path):
    """Damage is found by a checksum, and not by the times of files."""
    cache = tmp_path / "cache"
    run(tmp_path, cache)
    (file,) = cache.rglob(pattern)
    file.write_bytes(file.read_bytes()[:-100] + bytes(100))
    then = time.time() + ahead
    os.utime(file, (then, then))
    value, loaded, errors = run(tmp_path, cache)
    assert (value, loaded) == ("6.0", "0")
    assert "is damaged and will be written again" in errors and "Traceback" not in errors
    assert run(tmp_path, cache)[1] == "1"


@USERS
def test_no_data_are_written_to_or_read_from_a_folder_that_others_can_write(tmp_path, capsys):
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
