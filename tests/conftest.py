"""Hypothesis profiles: ``check`` is reproducible, ``deep`` searches, ``first`` ends at a failure.

Of two processes that run all tests, one compiles the general kernels first and the other the Taylor method's.
Each computes with one thread: more would wait for each other.
"""

import gc
import os

import pytest
from hypothesis import Phase, settings

os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

settings.register_profile("check", max_examples=25, deadline=None, derandomize=True, database=None)
settings.register_profile("deep", max_examples=500, deadline=None, print_blob=True)
settings.register_profile("first", settings.get_profile("check"), phases=(Phase.generate,))
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "check"))

MANY = 2000  # tests, among which every kernel is needed
GENERAL = ("alf-dual+projection", "mpi-svd+partitioning", "lm1+none/rk4", "lm2+projection/adams")


def pytest_collection_finish(session: pytest.Session) -> None:
    """Compile this process's share of the kernels, which takes no time where they are in the cache; what has
    been imported is not searched for garbage again."""
    gc.freeze()
    if len(session.items) < MANY:
        return
    match os.environ.get("PYTEST_XDIST_WORKER"):
        case "gw0":
            from mbref.method import Method
            from mbref.stepping.preparation import prepare

            for name in GENERAL:
                prepare(Method.parse(name))
        case "gw1":
            from mbref.taylor.preparation import prepare_series

            prepare_series()
