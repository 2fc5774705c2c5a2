"""The command ``crosscheck``: its options and the tables that it prints."""

import gc
import os
import sys

# before NumPy is imported: with several threads, small matrices take several times the CPU time
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
collects = gc.isenabled()
gc.disable()  # garbage collection would only cost time during the imports
try:
    from crosscheck.cli.commands import main
except KeyboardInterrupt:  # the program is not yet ready to report it
    print("interrupted", file=sys.stderr)
    sys.exit(130)

gc.freeze()
if collects:
    gc.enable()

__all__ = ["main"]
