"""One set of settings for all the paper's runs, what is varied to see what they matter, and its scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.scenes.planar_slider_crank import FLYWHEEL

INTEGRATOR = "adams"
END = 20.0  # s
IMPERFECTION = 1e-10  # m

REASONS: Mapping[str, str] = {
    "integrator adams": "variable-order Adams PECE after Shampine and Gordon, the usual code of the time",
    "rtol = 1e-06": "local error a step, relative and absolute",
    "smallest_step = forced_step = 1e-06": "s; a step this short is taken whatever its error estimate, so "
    "that a run goes on until its violation ends it, as the paper's do",
    "largest_step = 0.01": "s, about the paper's 103 steps a second",
    "largest_turn = 1.2": "rad a body may turn in a step; 1.248 at 0.01 s is too far for Newton–Raphson in "
    "the spatial slider-crank: it then completes 20 s on the wrong branch, 3.1 rad off",
    "violation = 0.003": "largest |Φ| tolerated, m or rad",
    "rank_tolerance = 1e-10": "relative, of singular values and pivots",
    "imperfection 1e-10 m": "joint C shifted along x: data of finite precision; the linkages only. Direction "
    "and size were chosen after trying others, so the number of matches carries that choice",
    "Baumgarte α = β = 5": "as printed",
    "ALF α = 1e4, ω = 10, μ = 1, 100 iterations": "α is not given; it weights rows of unit length here",
    "ALF ε = 1e-6": "relative to |q̈|, about 1e4 in these units in the linkages: 1e-2 absolutely",
    "MPI (GS)": "mpi-gs, Gram–Schmidt for any rank; as printed (mpi-gs-literal) it needs independent "
    "columns and is singular at θ₂ = nπ",
    "sample times": "every 0.2 s: steps end at samples, so many would change the runs",
}
LIMITS: Mapping[str, float] = {
    "rtol": 1e-6, "smallest_step": 1e-6, "forced_step": 1e-6, "largest_step": 0.01, "largest_turn": 1.2,
    "violation": 3e-3, "rank_tolerance": 1e-10,
}  # fmt: skip

ALF = "alf[alpha=1e4,epsilon=1e-6,iterations=100]"
FORMULATIONS = {"LM1": "lm1", "LM2": "lm2", "ALF": ALF, "MPI (SVD)": "mpi-svd", "MPI (GS)": "mpi-gs"}
STABILISATIONS = {"": "none", "B": "baumgarte", "CP": "partitioning"}


@dataclass(frozen=True)
class Variant:
    """The settings, or what differs from them in one point of the sweep."""

    name: str = "the settings"
    limits: Mapping[str, float] = field(default_factory=dict)
    imperfection: float = IMPERFECTION
    integrator: str = INTEGRATOR

    def options(self) -> dict[str, float]:
        """All numbers of ``mbref.simulate.Limits``."""
        return {**LIMITS, **self.limits}


BASE = Variant()
SWEEP: tuple[Variant, ...] = (
    Variant("rtol 1e-5", {"rtol": 1e-5}),
    Variant("violation 3e-2", {"violation": 3e-2}),
    Variant("smallest step 1e-5", {"smallest_step": 1e-5, "forced_step": 1e-5}),
    Variant("no forced step", {"smallest_step": 0.0, "forced_step": 0.0}),
    Variant("imperfection 0", imperfection=0.0),
    Variant("imperfection 1e-8 m", imperfection=1e-8),
    Variant("integrator dop853", integrator="dop853"),
)


def method(row: str, integrator: str = INTEGRATOR) -> str:
    """mbref's name of a row of the tables."""
    formulation, _, stabilisation = row.partition(" + ")
    return f"{FORMULATIONS[formulation]}+{STABILISATIONS[stabilisation]}/{integrator}"


def kinematic(scene: Scene) -> Scene:
    """The scene without masses: M = I and no forces, the paper's section 5.1."""
    return scene.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body))


def imperfect(scene: Scene, shift: float) -> Scene:
    """The scene with joint C's anchor shifted along x by ``shift`` (m), which changes two lengths."""
    at = next(k for k, joint in enumerate(scene.joint) if joint.name == "C")
    x, y, z = scene.joint[at].anchor
    moved = scene.joint[at].model_copy(update={"anchor": (x + shift, y, z)})
    return scene.with_(joint=(*scene.joint[:at], moved, *scene.joint[at + 1 :]))


def heavy_crank(scene: Scene, axis: int) -> Scene:
    """The scene with the flywheel of ``planar_slider_crank_heavy`` on its crank, a disc about a body axis."""
    crank = scene.body[0]
    disc = [FLYWHEEL if k == axis else FLYWHEEL / 2 for k in range(3)]
    inertia = tuple(i + j for i, j in zip(crank.inertia, disc, strict=True))
    body = (crank.model_copy(update={"inertia": inertia}), *scene.body[1:])
    return scene.with_(body=body, name=f"{scene.name}_heavy", duration=END)


def column_scene(column: str, imperfection: float = IMPERFECTION) -> Scene:
    """The mechanism of a column of Tables I to III."""
    if column.startswith("spatial"):
        return kinematic(SCENES["spatial_slider_crank_driven"]())
    return imperfect(kinematic(SCENES[LINKAGES[column][0]]()), imperfection)


LINKAGES = {  # column → scene and θ₂ at t = 0
    "θ₂ = nπ": ("four_bar_straight", math.pi),
    "θ₂ = π/4": ("four_bar_quarter", math.pi / 4),
    "θ₂ = π/2": ("four_bar", math.pi / 2),
    "five-bar": ("five_bar", math.pi / 2),
}
