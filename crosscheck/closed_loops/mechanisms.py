"""The mechanisms of the page on closed loops: one scene for each difficulty of a closed loop."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from mbref.scene import Scene
from mbref.scenes import SCENES

FOLDER = Path(__file__).parent / "scenes"
ROOT = FOLDER.parents[2]


class Difficulty(NamedTuple):
    """A column of the table: its heading, the sentence that explains the difficulty, and its scene.

    ``scene`` is a built-in name or the stem of a file in FOLDER, ``end`` the end time in s.
    """

    heading: str
    about: str
    scene: str
    end: float

    def make(self) -> Scene:
        """Return the scene up to ``end``."""
        found = SCENES[self.scene]() if self.scene in SCENES else Scene.from_file(FOLDER / self._file)
        return found.with_(duration=self.end)

    def place(self) -> str:
        """Return the name or the path of the scene in a command line, from the root of the checkout."""
        return self.scene if self.scene in SCENES else str((FOLDER / self._file).relative_to(ROOT))

    @property
    def _file(self) -> str:
        return f"{self.scene}.toml"


DIFFICULTIES = (
    Difficulty("four-bar", "A planar four-bar of four hinges swings under gravity.", "four_bar_free", 1.0),
    Difficulty(
        "redundant",
        "A coupler hangs on three parallel cranks; one crank more than needed.",
        "three_cranks",
        1.0,
    ),
    Difficulty(
        "Bennett", "Bennett's spatial four-bar of four hinges; three rows are redundant.", "bennett", 1.0
    ),
    Difficulty(
        "singular",
        "A slider-crank with equal crank and rod passes a singular position at 0.07 s.",
        "planar_slider_crank_equal",
        0.1,
    ),
    Difficulty(
        "turned", "The four-bar of the first column, turned by 0.7 rad in space.", "four_bar_turned", 1.0
    ),
    Difficulty("driven", "The four-bar, its crank driven by a polynomial.", "four_bar_driven", 1.0),
    Difficulty(
        "stiff spring",
        "The four-bar with a spring of 1e6 N/m and a damper at its rocker.",
        "four_bar_stiff",
        0.2,
    ),
    Difficulty("long run", "The four-bar for 5 s.", "four_bar_long", 5.0),
    Difficulty("coupling", "Two four-bars whose cranks are geared.", "geared_loops", 0.5),
)
