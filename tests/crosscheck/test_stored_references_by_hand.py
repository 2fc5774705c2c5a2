"""Files of references / arrays that are stored and read, and files that are damaged."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import numpy as np
import pytest

from crosscheck.judge.reference import cache
from mbref.scene import Body, Scene

SCENE = Scene(
    name="s",
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0)),),
    duration=2.0,
)
ARRAYS = {"times": np.array([0.0, 0.5]), "bound": np.arange(6.0).reshape(2, 3)}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "mbref" / "references"


def test_stored_arrays_are_read_again(folder):
    assert cache.load(SCENE) == {}
    cache.save(SCENE, ARRAYS)
    found = cache.load(SCENE)
    assert found.keys() == ARRAYS.keys() and all((found[n] == ARRAYS[n]).all() for n in ARRAYS)
    [path] = folder.iterdir()
    assert re.fullmatch("[0-9a-f]{64}", path.name), "no part of a file is left"
    cache.save(SCENE, {"times": np.array([3.0])})
    assert [*folder.iterdir()] == [path] and cache.load(SCENE)["times"].tolist() == [3.0]


def test_a_file_belongs_to_what_determines_the_motion(folder):
    """Name and duration do not; gravity does."""
    cache.save(SCENE, ARRAYS)
    assert cache.load(SCENE.with_(name="other", duration=9.0)).keys() == ARRAYS.keys()
    heavy = SCENE.with_(gravity=(0.0, -1.0, 0.0))
    assert cache.load(heavy) == {} and cache.canonical(heavy) != cache.canonical(SCENE)
    assert cache.canonical(SCENE) == cache.canonical(SCENE.with_(name="other", duration=9.0))
    assert cache.mechanism(SCENE) == hashlib.sha256(cache.canonical(SCENE).encode()).hexdigest()[:16]


@pytest.mark.parametrize("where", [0, 31, 32, 40, -1])
def test_a_file_with_one_other_byte_is_not_read(folder, where):
    cache.save(SCENE, ARRAYS)
    [path] = folder.iterdir()
    content = bytearray(path.read_bytes())
    content[where] ^= 1
    path.write_bytes(content)
    assert cache.load(SCENE) == {}


@pytest.mark.parametrize("body", [b"text", b"PK\x03\x04"])
def test_a_file_of_another_kind_is_not_read(folder, body):
    cache.save(SCENE, ARRAYS)
    [path] = folder.iterdir()
    path.write_bytes(hashlib.sha256(body).digest() + body)
    assert cache.load(SCENE) == {}


def test_without_a_folder_nothing_is_stored(folder):
    folder.parent.mkdir()
    folder.write_text("a file in place of the folder")
    cache.save(SCENE, ARRAYS)
    assert cache.load(SCENE) == {}


def test_files_are_in_the_home_folder_by_default(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", lambda: Path("/home/someone"))
    assert cache._path(SCENE).parent == Path("/home/someone/.cache/mbref/references")


def test_sources_on_which_a_reference_depends():
    """All of the reference except certified tables, and the judge's joints and functions of time."""
    names = {path.relative_to(cache.JUDGE).as_posix() for path in cache.SOURCES}
    assert {"reference/tree.py", "reference/natural.py", "arithmetic.py", "time_functions.py"} <= names
    assert not names & {"reference/certify.py", "reference/isostatic.py", "metrics.py"}
    assert all(path.exists() for path in cache.SOURCES)
    content = b"".join(path.read_bytes() for path in cache.SOURCES)
    assert cache.version() == hashlib.sha256(content).hexdigest()
