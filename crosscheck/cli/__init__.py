"""The command ``crosscheck``: its options and the tables that it prints."""

import gc
import os

# before NumPy is imported: with several threads, small matrices take several times the CPU time
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
collects = gc.isenabled()
gc.disable()  # garbage collection would only cost time during the imports
from crosscheck.cli.commands import main  # noqa: E402

gc.freeze()
if collects:
    gc.enable()

__all__ = ["main"]
