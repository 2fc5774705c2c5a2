"""The runs of the paper's tables and figures, each with a label by which its record is found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from crosscheck.engine import Setting, engine
from crosscheck.paper import settings
from crosscheck.paper.cells import CELLS, COUNTS_III, COUNTS_IV, FIVE_BAR, FOUR_BAR_COLUMNS, SPATIAL, Cell
from crosscheck.paper.settings import BASE, DRAWN, END, FEW, SEEDS, SIZED, STRICT, SWEEP, TIGHT, Variant
from crosscheck.study.grid import Case, Record
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene
from mbref.scenes import SCENES

ENGINE = "mbref"  # the engine that has the paper's methods
SHARE = 0.95  # fraction of a failed run's end time at which its error is measured
SAMPLES = np.linspace(0.0, END, 101)
SHORT = np.linspace(0.0, 0.12, 61)  # s; samples every 2 ms over two revolutions
TURNS = np.linspace(0.0, END, 201)
SECOND = np.linspace(0.0, 1.0, 6)
FINE = np.linspace(0.0, END, 2001)  # s; samples every 10 ms, to show the peaks at singular positions
SIZED_ROWS = (
    "MPI (SVD)",
    "ALF",
    "ALF + CP",
)  # rows of the paper's tables whose end times are plotted over the size of random data errors
FREE = ("LM2", "MPI (SVD)", "MPI (GS)")  # rows of Table III whose constraints drift until they fail
LASTING = ("MPI (SVD) + CP", "MPI (GS) + CP")  # the rows of Tables I and II whose runs last 20 s

HEAVY, UNEQUAL, SPATIAL_DYNAMIC = "a = b", "a ≠ b", "spatial"
TRUE_BRANCH = "taylor"
FIGURES: Mapping[str, tuple[str, ...]] = {  # column → rows whose motion is plotted
    "θ₂ = π/2": ("ALF", "MPI (GS)", "MPI (SVD)", "MPI (GS) + B", "MPI (GS) + CP", "MPI (SVD) + CP"),
    FIVE_BAR: ("MPI (GS)", "MPI (SVD)", "MPI (SVD) + CP"),
}
CROSSING = (
    "ALF",
    "MPI (GS)",
    "MPI (SVD)",
    "MPI (GS) + B",
    "MPI (SVD) + B",
    "ALF + CP",
    "MPI (GS) + CP",
    "MPI (SVD) + CP",
)
DYNAMIC: Mapping[str, tuple[str, ...]] = {
    HEAVY: CROSSING,
    UNEQUAL: ("ALF + CP", "MPI (SVD) + CP", "MPI (GS) + CP", "ALF", "MPI (SVD)", "MPI (GS)"),
    SPATIAL_DYNAMIC: (*COUNTS_IV, "ALF"),
}
HEAVY_SWEEP = tuple(v for v in SWEEP if v.name in ("rtol 1e-5", "smallest step 1e-5", "α = 1e6"))
[RAISED] = [v for v in SWEEP if v.name == "rank 1e-4"]
KEPT, KEPT_RTOLS = (0.6, 0.3, 0.1, 0.03), (1e-6, 1e-7, 1e-8, 1e-9)
ALPHAS = tuple(10.0**k for k in range(2, 13))
DIGITS_EPSILON = 1e-14  # tolerance ε of ALF near rounding
EXACT, PENALTY, DUAL = "mpi-svd", "alf", "alf-dual"


ERRORS = tuple(10.0**-k for k in range(4, 10))  # tolerances at which the growth of the violation is shown
GAINS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)  # α = β of Baumgarte, 1/s
GROWTH, GAIN = "growth", "gain"
TEACHING = np.linspace(0.0, 2.0, 101)  # s, sample times of the runs for lectures


class Label(NamedTuple):
    """Label of a run: table, figure or sweep; its row and column; the varied setting."""

    part: str
    row: str
    column: str
    variant: str = BASE.name

    def __str__(self) -> str:
        part = f"Table {self.part}" if self.part in ("I", "II", "III") else self.part
        varied = (self.variant,) if self.variant != BASE.name else ()
        return ", ".join(filter(None, (part, self.row, self.column, *varied)))


PEAKS = Label("peaks", "MPI (GS) + CP", HEAVY)
Cases = dict[Label, Case]
Records = dict[Label, Record]


def cases() -> Cases:
    """Return every run that the tables and figures need, except follow-up runs and timings."""
    return {
        **tables(),
        **drawn(),
        **strict(),
        **figures(),
        **dynamic(),
        **kept(),
        **tight(),
        **growth(),
        **gains(),
    }


def studies() -> Cases:
    """Return the runs of the studies of settings and methods that follow the tables and figures."""
    return {**sweep(), **sized(), **settings_of_cranks(), **pairs(), **digits()}


def tables() -> Cases:
    """Return one run for each cell of Tables I to III."""
    return {Label(c.table, c.row, c.column): linkage(c.row, c.column, SAMPLES) for c in CELLS}


def draws(cell: Cell) -> int:
    """Return the number of random first steps and data errors of a cell; 1 if they have no influence."""
    if cell.letter == "a" or (cell.table == "III" and cell.row not in FREE):
        return 1
    return FEW if cell.table == "III" or cell.row in LASTING else SEEDS


def drawn() -> Cases:
    """Return the cells again with other random first steps and data errors."""
    return {
        label: case
        for cell in CELLS
        for label, case in _varied("drawn", [(cell.row, cell.column)], DRAWN[: draws(cell) - 1]).items()
    }


def sweep() -> Cases:
    """Return the cells that fail at singular positions in the paper, with one setting varied at a time."""
    places = [(c.row, c.column) for c in CELLS if c.table != "III" and c.letter not in ("a", "")]
    return _varied("sweep", places, SWEEP)


def sized() -> Cases:
    """Return some rows for several sizes of the data errors, each with several random draws."""
    places = [(row, column) for column in (*FOUR_BAR_COLUMNS, FIVE_BAR) for row in SIZED_ROWS]
    return _varied("sized", places, SIZED, SHORT[[-1]])


def strict() -> Cases:
    """Return Table III's drifting rows at the tolerances that the paper's numbers of steps suggest."""
    return _varied("strict", [(row + b, SPATIAL) for row in FREE for b in ("", " + B")], (STRICT,))


def _varied(
    part: str, places: Iterable[tuple[str, str]], variants: Iterable[Variant], times: np.ndarray = SAMPLES
) -> Cases:
    return {
        Label(part, row, column, variant.name): linkage(row, column, times, variant)
        for variant in variants
        for row, column in places
        if not variant.alf or "ALF" in row
    }


def figures() -> Cases:
    """Return the runs of Figures 4, 5, 6 and 8: the linkages, sampled every 2 ms."""
    return {
        Label("figures", row, column): linkage(row, column, SHORT)
        for column, rows in FIGURES.items()
        for row in rows
    }


def dynamic_scene(column: str) -> Scene:
    """Return the mechanism of Figures 11 to 16 and Table IV: 100 N m on a crank with a flywheel, from
    rest."""
    if column == HEAVY:
        return SCENES["planar_slider_crank_heavy"]()
    if column == UNEQUAL:
        return settings.heavy_crank(SCENES["planar_slider_crank"](), 2)
    return settings.heavy_crank(SCENES["spatial_slider_crank"](), 1, settings.SPATIAL_FLYWHEEL)


def dynamic() -> Cases:
    """Return the runs of Figures 11 to 16 and Table IV; for a = b also with dense samples, and by Taylor
    series on the smooth branch."""
    out = {
        Label("dynamic", row, column): _case(dynamic_scene(column), row, TURNS)
        for column, rows in DYNAMIC.items()
        for row in rows
    }
    out[PEAKS] = _case(dynamic_scene(HEAVY), PEAKS.row, FINE)
    out[Label("dynamic", TRUE_BRANCH, HEAVY)] = Case(
        dynamic_scene(HEAVY), TURNS, ENGINE, Setting("taylor", {"rtol": 1e-9})
    )
    return out


def settings_of_cranks() -> Cases:
    """Return the runs of the planar slider-cranks of Figures 11 to 14 at other settings."""
    scene, out = dynamic_scene(HEAVY), {}
    for variant in HEAVY_SWEEP:
        for row in CROSSING:
            if not variant.alf or "ALF" in row:
                out[Label("dynamic", row, HEAVY, variant.name)] = _case(scene, row, TURNS, variant)
    raised = _case(dynamic_scene(UNEQUAL), "MPI (SVD)", TURNS, RAISED)
    return out | {Label("dynamic", "MPI (SVD)", UNEQUAL, RAISED.name): raised}


def teaching_scene() -> Scene:
    """Return the spatial slider-crank under 100 N m, which has no redundant constraints and no singular
    positions."""
    return dynamic_scene(SPATIAL_DYNAMIC)


def growth() -> Cases:
    """Return runs by LM2 without stabilisation at several tolerances (Figure 2's procedure)."""
    return {
        Label(GROWTH, "LM2", SPATIAL_DYNAMIC, f"{rtol:g}"): _case(
            teaching_scene(), "LM2", TEACHING, Variant(f"{rtol:g}", {"rtol": rtol, "violation": 1e9})
        )
        for rtol in ERRORS
    }


def gains() -> Cases:
    """Return runs by LM2 with Baumgarte's stabilisation for several α = β."""
    return {
        Label(GAIN, "LM2 + B", SPATIAL_DYNAMIC, f"{gain:g}"): _named(
            teaching_scene(), f"lm2+baumgarte[{gain:g},{gain:g}]/{settings.INTEGRATOR}", TEACHING
        )
        for gain in GAINS
    }


def kept() -> Cases:
    """Return runs of Table IV's mechanism by LM2, with and without partitioning, over the tolerance and the
    threshold for a new partition."""
    scene, out = dynamic_scene(SPATIAL_DYNAMIC), {}
    for rtol in KEPT_RTOLS:
        variant = Variant(f"rtol {rtol:g}", {"rtol": rtol})
        for name in ("none", *(f"partitioning[kept={share:g}]" for share in KEPT)):
            method = f"lm2+{name}/{settings.INTEGRATOR}"
            out[Label("kept", name, SPATIAL_DYNAMIC, variant.name)] = _named(scene, method, TURNS, variant)
    return out


def tight() -> Cases:
    """Return the runs of Table IV at the tolerance that was probably used in the paper."""
    scene = dynamic_scene(SPATIAL_DYNAMIC)
    return {
        Label("tight", row, SPATIAL_DYNAMIC, TIGHT.name): _case(scene, row, TURNS, TIGHT) for row in COUNTS_IV
    }


def pairs() -> Cases:
    """Return runs of every formulation with every stabilisation on the driven spatial slider-crank, 20 s."""
    scene, parts = settings.column_scene(SPATIAL), engine(ENGINE).family_parts()
    return {
        Label("pairs", f, s): _named(scene, f"{BASE.formulation(f)}+{s}/{settings.INTEGRATOR}", SAMPLES)
        for f in parts["formulation"]
        for s in parts["stabilisation"]
    }


def digits_scene() -> Scene:
    """Return the moving mechanism on which the accelerations of ALF and its dual form at t = 0 are
    compared."""
    return SCENES["spatial_slider_crank_gravity"]()


def digits() -> Cases:
    """Return runs for the accelerations at t = 0 by ALF and its dual form over the penalty."""
    scene, once = digits_scene(), np.zeros(1)
    out = {Label("digits", EXACT, ""): _named(scene, f"{EXACT}+none", once)}
    for alpha in ALPHAS:
        for name in (PENALTY, DUAL):
            text = f"{name}[alpha={alpha:g},epsilon={DIGITS_EPSILON},iterations=100]+none"
            out[Label("digits", name, f"{alpha:g}")] = _named(scene, text, once)
    return out


def follow_ups(records: Records) -> Cases:
    """Return runs that repeat runs which failed before the first sample, with a sample shortly before the
    end.

    The error is measured at that sample.
    """
    out = {}
    for cell in CELLS:
        record = records[Label(cell.table, cell.row, cell.column)]
        if record["outcome"] != Outcome.COMPLETED.label and 0 < record["t_end"] < SAMPLES[1]:
            at = np.array([SHARE * record["t_end"]])
            out[Label("error", cell.row, cell.column)] = linkage(cell.row, cell.column, at)
    return out


def timed() -> Cases:
    """Return the rows of Tables III and IV whose times are compared: one second of Table III, all of Table
    IV."""
    one = {Label("timed", row, SPATIAL): linkage(row, SPATIAL, SECOND) for row in COUNTS_III}
    scene = dynamic_scene(SPATIAL_DYNAMIC)
    return one | {Label("timed", row, SPATIAL_DYNAMIC): _case(scene, row, TURNS) for row in COUNTS_IV}


def has(records: Iterable[Label], part: str) -> bool:
    """Return whether there are records of a part."""
    return any(label.part == part for label in records)


def found(records: Mapping[Label, Record], cell: Cell, parts: Iterable[str]) -> dict[str, Record]:
    """Return the cell's records of the ``parts`` (tables, sweeps …), by variant."""
    wanted = {cell.table if part == "tables" else part for part in parts}
    return {
        label.variant: record
        for label, record in records.items()
        if label.part in wanted and (label.row, label.column) == (cell.row, cell.column)
    }


def linkage(row: str, column: str, times: Iterable[float], variant: Variant = BASE) -> Case:
    """Return the run of a cell of Tables I to III at the given times and settings."""
    return _case(settings.column_scene(column, variant), row, np.asarray(times), variant)


def _case(scene: Scene, row: str, times: np.ndarray, variant: Variant = BASE) -> Case:
    return _named(scene, settings.method(row, variant), times, variant)


def _named(scene: Scene, method: str, times: np.ndarray, variant: Variant = BASE) -> Case:
    return Case(scene, times, ENGINE, Setting(method, variant.options()))
