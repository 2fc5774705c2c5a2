"""The table of planted defects / the sources and tests that it names."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutants.defects import DEFECTS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("file", sorted({defect.file for defect in DEFECTS}))
def test_every_defect_has_one_place(file: str):
    source = (ROOT / file).read_text()
    for defect in (d for d in DEFECTS if d.file == file):
        assert source.count(defect.old) == 1, f"{file} has {defect.old!r} {source.count(defect.old)} times"
        for node in defect.tests.split():
            assert (ROOT / node.split("::")[0]).exists(), node
