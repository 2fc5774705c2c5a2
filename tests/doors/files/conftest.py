"""Fixtures of tests of files."""

import pytest

from tests.helpers.imports import Files


@pytest.fixture
def files(tmp_path, capsys) -> Files:
    """Return the command that imports files, in an empty folder."""
    return Files(tmp_path, capsys)
