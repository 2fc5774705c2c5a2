"""Ctrl-C ends a command with one word and the exit status 130, also while its modules are imported."""

import signal
import subprocess
import sys
import time

import pytest

from mbref.command_line import status_of

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


def test_interrupt_that_python_loses_while_it_removes_an_object_ends_the_command_too(capsys):
    """Python prints a traceback for an exception in ``__del__``, and goes on: the command would sleep on."""

    class Removed:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    def action() -> int:
        Removed()
        time.sleep(30.0)
        return 0

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert status_of(action) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "interrupted\n"
