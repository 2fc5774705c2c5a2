"""Ctrl-C ends a command with one word and the exit status 130, also while its modules are imported."""

import subprocess
import sys

import pytest

PRESSED = """
import signal, sys

class Pressed:
    @staticmethod
    def find_spec(name, *_):
        if name == sys.argv[1] + ".commands":
            signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background ignores
sys.meta_path.insert(0, Pressed)
__import__(sys.argv[1])
"""


@pytest.mark.parametrize("program", ["mbref.cli", "crosscheck.cli"])
def test_interrupt_of_an_import_ends_a_command_with_one_word(program) -> None:
    """A finder of modules sends the signal when the module of the program's commands is asked for."""
    words = [sys.executable, "-c", PRESSED, program]
    ran = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (130, "", "interrupted\n")
