"""Imports by the command line leave the garbage collector as it was."""

import gc

import pytest

from mbref.imports import without_collection


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
