"""The command line of mbref."""

import gc

collects = gc.isenabled()
gc.disable()  # garbage collection during the imports would take a fifth of the time of a short run
from mbref.cli.commands import main  # noqa: E402

gc.freeze()
if collects:
    gc.enable()

__all__ = ["main"]
