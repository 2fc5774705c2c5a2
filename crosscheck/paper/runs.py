"""The runs behind the paper's tables and figures, each with a label to find its record by."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crosscheck.engine import Setting
from crosscheck.paper import settings
from crosscheck.paper.cells import CELLS, COUNTS_IV, FIVE_BAR, FOUR_BAR_COLUMNS, SPATIAL
from crosscheck.paper.settings import BASE, END, SWEEP, Variant
from crosscheck.study import Case, Record, study
from crosscheck.study import Progress as Advance
from mbref.formulations import FORMULATIONS
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.stabilisation import STABILISATIONS
from mbref.trajectory import Outcome

LIMIT = 60.0  # s of wall time, of one run
SHARE = 0.95  # of the end time of a failed run, where its error is taken
SAMPLES = np.linspace(0.0, END, 101)
SHORT = np.linspace(0.0, 0.12, 61)  # every 2 ms over two revolutions
TURNS = np.linspace(0.0, END, 401)
SWEPT_ROWS = ("ALF", "ALF + CP", "MPI (SVD)", "MPI (SVD) + B", "MPI (GS)", "MPI (GS) + B")
MPI_CP = "MPI (SVD) + CP"  # swept too where the paper's run fails, in Table II

HEAVY, UNEQUAL, SPATIAL_DYNAMIC = "a = b", "a ≠ b", "spatial"
TRUE_BRANCH = "alf-dual + projection"
FIGURES: Mapping[str, tuple[str, ...]] = {  # column → rows whose motion is drawn
    "θ₂ = π/2": ("ALF", "MPI (GS)", "MPI (SVD)", "MPI (GS) + B", "MPI (GS) + CP", "MPI (SVD) + CP"),
    FIVE_BAR: ("MPI (GS)", "MPI (SVD)", "MPI (SVD) + CP"),
}
DYNAMIC: Mapping[str, tuple[str, ...]] = {
    HEAVY: ("ALF", "MPI (GS)", "MPI (GS) + B", "MPI (GS) + CP", "MPI (SVD)", "MPI (SVD) + CP"),
    UNEQUAL: ("ALF + CP", "MPI (SVD) + CP", "MPI (GS) + CP", "ALF", "MPI (SVD)", "MPI (GS)"),
    SPATIAL_DYNAMIC: (*COUNTS_IV, "ALF"),
}
ALPHAS = tuple(10.0**k for k in range(2, 13))
DIGITS_EPSILON = 1e-14  # so that only rounding is left
EXACT, PENALTY, DUAL = "mpi-svd", "alf", "alf-dual"


class Label(NamedTuple):
    """Where a run belongs: table, figure or sweep; its row and column; what is special about it."""

    part: str
    row: str
    column: str
    variant: str = BASE.name


Cases = dict[Label, Case]
Records = dict[Label, Record]


def cases() -> Cases:
    """Every run but the follow-ups."""
    return {**tables(), **sweep(), **figures(), **dynamic(), **pairs(), **digits()}


def tables() -> Cases:
    """One run a cell of Tables I to III."""
    return {Label(c.table, c.row, c.column): linkage(c.row, c.column, SAMPLES) for c in CELLS}


def sweep() -> Cases:
    """The cells of Tables I and II that end at singular positions, one setting varied at a time."""
    places = [(row, column) for column in (*FOUR_BAR_COLUMNS, FIVE_BAR) for row in SWEPT_ROWS]
    return {
        Label("sweep", row, column, variant.name): linkage(row, column, SAMPLES, variant)
        for variant in SWEEP
        for row, column in (*places, (MPI_CP, FIVE_BAR))
    }


def figures() -> Cases:
    """Figures 4, 5, 6 and 8: the linkages, sampled every 2 ms."""
    return {
        Label("figures", row, column): linkage(row, column, SHORT)
        for column, rows in FIGURES.items()
        for row in rows
    }


def dynamic_scene(column: str) -> Scene:
    """The mechanism of Figures 11 to 16 and Table IV: 100 N m on a crank with a flywheel, from rest."""
    if column == HEAVY:
        return SCENES["planar_slider_crank_heavy"]()
    if column == UNEQUAL:
        return settings.heavy_crank(SCENES["planar_slider_crank"](), 2)
    return settings.heavy_crank(SCENES["spatial_slider_crank"](), 1)


def dynamic() -> Cases:
    """Figures 11 to 16 and Table IV; for a = b also a run that keeps to the smooth branch."""
    out = {
        Label("dynamic", row, column): _case(dynamic_scene(column), settings.method(row), TURNS)
        for column, rows in DYNAMIC.items()
        for row in rows
    }
    branch = Setting("alf-dual+projection/dop853", {"rtol": 1e-9})
    out[Label("dynamic", TRUE_BRANCH, HEAVY)] = Case(dynamic_scene(HEAVY), TURNS, "mbref", branch, LIMIT)
    return out


def pairs() -> Cases:
    """Every formulation with every stabilisation on the driven spatial slider-crank, 20 s."""
    scene = settings.column_scene(SPATIAL)
    return {
        Label("pairs", f, s): _case(scene, f"{formulation}+{s}/{settings.INTEGRATOR}", SAMPLES)
        for f in FORMULATIONS
        for s in STABILISATIONS
        for formulation in (settings.ALF.replace("alf", f, 1) if f.startswith("alf") else f,)
    }


def digits() -> Cases:
    """The accelerations at t = 0 of a moving mechanism by ALF and its dual over the penalty."""
    scene, once = SCENES["spatial_slider_crank_gravity"](), np.zeros(1)
    out = {Label("digits", EXACT, ""): _case(scene, f"{EXACT}+none", once)}
    for alpha in ALPHAS:
        for name in (PENALTY, DUAL):
            text = f"{name}[alpha={alpha:g},epsilon={DIGITS_EPSILON},iterations=100]+none"
            out[Label("digits", name, f"{alpha:g}")] = _case(scene, text, once)
    return out


def follow_ups(records: Records) -> Cases:
    """Failed runs of the tables again with one sample shortly before the end, to take the error there."""
    out = {}
    for cell in CELLS:
        record = records[Label(cell.table, cell.row, cell.column)]
        if record["outcome"] != Outcome.COMPLETED.label and record["t_end"] > 0:
            at = np.array([SHARE * record["t_end"]])
            out[Label("error", cell.row, cell.column)] = linkage(cell.row, cell.column, at)
    return out


def run(path: str | Path, chosen: Cases, progress: Advance | None = None) -> Records:
    """Records of the cases, stored at ``path`` as they end and taken from there where they are known."""
    records = study(list(chosen.values()), records_path=path, progress=progress)
    return dict(zip(chosen, records, strict=True))


def ends(records: Mapping[Label, Record], row: str, column: str) -> list[tuple[float, str]]:
    """The different end times (s, rounded to 0.1 ms) and letters of a cell over the sweep, in order."""
    found = {
        (round(record["t_end"], 4), Outcome[record["outcome"]].letter)
        for label, record in records.items()
        if label.part in ("sweep", "I", "II") and (label.row, label.column) == (row, column)
    }
    return sorted(found)


def linkage(row: str, column: str, times: Iterable[float], variant: Variant = BASE) -> Case:
    """The run of a cell of Tables I to III at the given times and settings."""
    scene = settings.column_scene(column, variant.imperfection)
    return _case(scene, settings.method(row, variant.integrator), np.asarray(times), variant)


def _case(scene: Scene, method: str, times: np.ndarray, variant: Variant = BASE) -> Case:
    return Case(scene, times, "mbref", Setting(method, variant.options()), LIMIT)
