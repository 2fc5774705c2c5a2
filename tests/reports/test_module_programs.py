"""Modules that are programs, too / each run as ``python -m`` in this process: what it prints and writes."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from types import ModuleType

import pytest

from reports import ladders


def run(module: ModuleType | Path, *words: str) -> None:
    path = module if isinstance(module, Path) else module.__file__
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["program", *words])
        runpy.run_path(str(path), run_name="__main__")


def test_ladders_are_kept_in_another_folder(tmp_path):
    record = {name: name for name in (*ladders.KEPT, *ladders.ORIGIN)} | {"bodies": [1]}
    (tmp_path / ladders.FILE).write_text(json.dumps(record) + "\n")
    run(ladders, str(tmp_path), str(tmp_path / "kept"))
    kept = json.loads((tmp_path / "kept" / ladders.FILE).read_text())
    assert "bodies" not in kept and kept["scene"] == "scene" and kept["date"] == "date"
    with pytest.raises(SystemExit):
        run(ladders, str(tmp_path))
