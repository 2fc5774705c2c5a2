"""How kernels are compiled, cached and given memory.

numba is imported here first, without the packages that it imports where they are installed and that compiled
kernels do not need: they take a tenth of the CPU time of a short run.
"""

from mbref.imports import without_packages

with without_packages("coverage", "yaml"):
    import numba

__all__ = ["numba"]
