"""Imports by the command line leave the garbage collector and the packages installed as they were."""

import gc
import subprocess
import sys

import pytest

from mbref.imports import without_collection, without_packages


@pytest.fixture(autouse=True)
def as_before():
    enabled = gc.isenabled()
    yield
    gc.unfreeze()
    (gc.enable if enabled else gc.disable)()


def test_imports_run_without_the_collector():
    gc.enable()
    with without_collection():
        assert not gc.isenabled()
    assert gc.isenabled()


def test_a_collector_that_was_off_stays_off():
    gc.disable()
    with without_collection():
        pass
    assert not gc.isenabled()


def test_a_failed_import_leaves_the_collector_on():
    gc.enable()
    with pytest.raises(ModuleNotFoundError), without_collection():
        import mbref.no_such_module  # noqa: F401
    assert gc.isenabled()


def test_hidden_packages_are_found_again():
    with without_packages("wave", "gc"):
        with pytest.raises(ModuleNotFoundError):
            import wave
        import gc  # which was imported before
    import wave

    assert wave and gc


def test_numba_comes_without_packages_that_kernels_do_not_need():
    """In a fresh process; coverage is installed here."""
    program = "import sys, mbref.kernels.compilation; print('coverage' in sys.modules); import coverage"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout == "False\n", ran.stdout
