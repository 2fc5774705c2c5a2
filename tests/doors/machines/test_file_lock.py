"""Locks between processes: who waits, and who does not."""

import subprocess
import sys

import pytest

from mbref.kernels.file_lock import held, is_held

pytest.importorskip("fcntl")
HOLD = "import sys; from pathlib import Path; from mbref.kernels.file_lock import held\n"
HOLD += "with held(Path(sys.argv[1])): print('holds', flush=True); sys.stdin.read()"


def holder(path):
    """A process that holds the lock until its input is closed."""
    command = [sys.executable, "-c", HOLD, str(path)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "holds\n"
    return process


def test_lock_is_held_only_inside_its_with_statement(tmp_path):
    """``is_held`` asks whether any process has the lock; it makes no file or folder."""
    path = tmp_path / "new folder" / "lock"
    assert not is_held(path) and not path.parent.exists()
    with held(path):
        assert is_held(path)
    assert not is_held(path)


@pytest.mark.parametrize(
    "end", [lambda process: process.stdin.close(), lambda process: process.kill()], ids=["ends", "killed"]
)
def test_lock_of_another_process_is_free_after_it_ends_or_is_killed(end, tmp_path):
    """``holder`` starts a process that has the lock until its input is closed."""
    with holder(tmp_path / "lock") as process:
        assert is_held(tmp_path / "lock")
        end(process)
        with held(tmp_path / "lock"):  # waits for the end of the block, or of the killed process
            pass
        process.wait()
    assert not is_held(tmp_path / "lock")
