"""Kernels compiled in a second process."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from mbref.kernels.background import PROGRAM, compiled_in_background

KEPT, MISSING = SimpleNamespace(is_kept=True), SimpleNamespace(is_kept=False)
SOURCE = """\
import os, time
def mark():
    open(os.environ["MARK"], "w").close()
def wait():
    mark()
    time.sleep(600)
"""


@pytest.fixture
def mark(tmp_path, monkeypatch):
    """The file that the function ``mark`` of the module ``second`` makes, in processes started now."""
    (tmp_path / "second.py").write_text(SOURCE)
    monkeypatch.setenv("MARK", str(tmp_path / "mark"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    return tmp_path / "mark"


def test_missing_kernels_are_compiled_by_the_end_of_the_block(mark):
    with compiled_in_background([KEPT, MISSING], "second", "mark"):
        pass
    assert mark.exists()


def test_kept_kernels_start_no_process(mark):
    with compiled_in_background([KEPT, KEPT], "second", "mark"):
        pass
    assert not mark.exists()


def test_one_core_has_no_second_process(mark, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    with compiled_in_background([MISSING], "second", "mark"):
        pass
    assert not mark.exists()


def test_a_second_process_that_fails_is_no_error(mark):
    with compiled_in_background([MISSING], "second", "absent"):
        pass
    assert not mark.exists()


def test_an_interrupted_block_ends_the_second_process(mark):
    with pytest.raises(KeyboardInterrupt), compiled_in_background([MISSING], "second", "wait"):
        raise KeyboardInterrupt


def test_the_second_process_ends_with_its_parent(mark):
    program = PROGRAM.format(module="second", function="wait")
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(60) == 1
