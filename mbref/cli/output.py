"""Output of the commands: tables that fit 80 columns, progress on terminals and in pipes, warnings."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from rich.console import Console

from mbref.scene import Scene
from mbref.scene_slips import probable_slips

PIPED_WIDTH = 80  # characters of a line where no terminal says otherwise
PAUSE = 10.0  # s between two lines of progress where stderr is no terminal


def console() -> Console:
    """The standard output, as wide as the terminal, 80 columns in a pipe; names are never markup."""
    return Console(width=None if sys.stdout.isatty() else PIPED_WIDTH, markup=False, highlight=False)


def warn(scene: Scene) -> None:
    """Tell on stderr of numbers in a scene that are probably slips."""
    for slip in probable_slips(scene):
        print(f"warning: {slip}", file=sys.stderr)


def rounded(vector: np.ndarray) -> np.ndarray:
    """Without the rounding errors of zeros, for reading."""
    return np.round(vector, 12) + 0.0


@contextmanager
def progress_bar(what: str, end: float) -> Iterator[Callable[[float], None]]:
    """Tells how far a long run is on stderr: a bar on a terminal, else a line every ten seconds."""
    from rich.progress import Progress

    on_stderr = Console(stderr=True)
    if not on_stderr.is_terminal:
        yield Lines(what, end, time.monotonic)
        return
    with Progress(console=on_stderr, transient=True) as bar:
        task = bar.add_task(what, total=end)
        yield lambda t: bar.update(task, completed=t)


class Lines:
    """Lines of progress by a clock (s): "simulating: 40 %, about 18 s left"."""

    def __init__(self, what: str, end: float, clock: Callable[[], float]):
        self._what, self._end, self._clock = what, end, clock
        self._began = self._said = clock()

    def __call__(self, done: float) -> None:
        """Told how far it is; writes a line where ten seconds have passed since the last."""
        now = self._clock()
        if now - self._said >= PAUSE and done > 0:
            self._said = now
            left = (now - self._began) * (self._end / done - 1)
            print(f"{self._what}: {100 * done / self._end:.0f} %, about {left:.0f} s left", file=sys.stderr)
