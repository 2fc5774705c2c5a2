"""Ctrl-C ends a command with one word and the exit status 130, also while its modules are imported."""

import gc
import signal
import sys
from importlib import import_module

import pytest


@pytest.mark.parametrize("program", ["mbref.cli", "crosscheck.cli"])
def test_interrupt_of_an_import_ends_a_command_with_one_word(program, monkeypatch, capsys) -> None:
    """A finder of modules sends the signal when the module of the program's commands is asked for."""

    class Pressed:
        @staticmethod
        def find_spec(name: str, *_: object) -> None:
            if name == f"{program}.commands":
                signal.raise_signal(signal.SIGINT)

    for name in (program, f"{program}.commands"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setattr(sys, "meta_path", [Pressed, *sys.meta_path])
    with pytest.raises(SystemExit, match="130"):
        import_module(program)
    gc.enable()  # programs turn it off while they import
    assert capsys.readouterr() == ("", "interrupted\n")
