"""The command `crosscheck`: its options, its lists and the tables it prints."""

import gc

collects = gc.isenabled()
gc.disable()  # no search for garbage among imported objects
from crosscheck.cli.commands import main  # noqa: E402

gc.freeze()
if collects:
    gc.enable()

__all__ = ["main"]
