"""Machine code of scenes on disk and, once loaded, in this process."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

from mbref.kernels import checked_file
from mbref.specialised.machine_code import Code, Piece, compiled

MOST = 64  # scenes whose code a process keeps loaded

_loaded: dict[Path, tuple[dict[str, int], Code]] = {}


def code_of(path: Path, pieces: Callable[[], Sequence[Piece]]) -> tuple[dict[str, int], Code]:
    """Operations by piece and the code: as loaded before, as kept at the path, or made of the pieces.

    Raises Untraceable where they cannot be made.
    """
    if path not in _loaded:
        data = checked_file.read(path) or _made(path, pieces())
        facts, _, machine_code = data.partition(b"\n")
        if len(_loaded) >= MOST:
            del _loaded[next(iter(_loaded))]
        _loaded[path] = json.loads(facts), Code(machine_code)
    return _loaded[path]


def _made(path: Path, pieces: Sequence[Piece]) -> bytes:
    facts = json.dumps({piece.name: len(piece.live()) for piece in pieces})
    data = facts.encode() + b"\n" + compiled(pieces)
    checked_file.write(path, data)
    return data
