"""The command line of mbref."""

import gc
import sys

collects = gc.isenabled()
gc.disable()  # garbage collection during the imports would take a fifth of the time of a short run
try:
    from mbref.cli.commands import main
except KeyboardInterrupt:  # the program is not yet ready to report it
    print("interrupted", file=sys.stderr)
    sys.exit(130)

gc.freeze()
if collects:
    gc.enable()

__all__ = ["main"]
