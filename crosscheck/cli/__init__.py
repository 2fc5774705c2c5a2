"""The command ``crosscheck``: its options and the tables that it prints."""

import gc

collects = gc.isenabled()
gc.disable()  # garbage collection would only cost time during the imports
from crosscheck.cli.commands import main  # noqa: E402

gc.freeze()
if collects:
    gc.enable()

__all__ = ["main"]
