"""Compiled kernels on disk: not loaded from a folder of others, and damage is found at any file time."""

from __future__ import annotations

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
    """Return the value, the number of kernels from the cache, and the errors of a program with a kernel."""
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
def test_a_new_cache_is_closed_to_others(tmp_path):
    before = os.umask(0)
    try:
        run(tmp_path, tmp_path / "cache")
        assert run(tmp_path, tmp_path / "cache")[1:] == ("1", "")
    finally:
        os.umask(before)


@pytest.mark.slow
@pytest.mark.parametrize("ahead", [5.0, 1e8])
@pytest.mark.parametrize("pattern", ["*.nbc", "*.nbi"])
def test_damaged_kernels_of_the_future_are_compiled_again(pattern, ahead, tmp_path):
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
def test_stored_data_of_a_folder_of_others_are_not_read(tmp_path, capsys):
    ours, open_to_all = tmp_path / "cache" / "ours", tmp_path / "cache" / "open"
    checked_file.write(ours / "data", b"kept")
    for folder in (tmp_path, ours.parent):  # which others can reach
        folder.chmod(0o755)
    open_to_all.mkdir()
    open_to_all.chmod(0o777)
    checked_file.write(open_to_all / "data", b"not kept")
    assert checked_file.read(ours / "data") == b"kept"
    assert not (open_to_all / "data").exists() and checked_file.read(open_to_all / "data") is None
    assert capsys.readouterr().err.count("can be written by other users") == 1
