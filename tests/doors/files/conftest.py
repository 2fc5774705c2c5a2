"""Fixtures of tests of files."""

from __future__ import annotations

import pytest

from tests.helpers.imports import Files


@pytest.fixture
def files(tmp_path, capsys) -> Files:
    """Return the command that imports files, in an empty folder."""
    return Files(tmp_path, capsys)
