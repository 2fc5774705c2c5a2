"""Scenes of the conformance suite, with their exact motions where a formula is known."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from crosscheck.conformance.mechanisms.closed_forms import CLOSED_FORMS, GEARED, Exact
from crosscheck.conformance.mechanisms.coupled import coupled_probes, driven_ball, event_probes
from crosscheck.conformance.mechanisms.features import feature_scenes
from crosscheck.conformance.mechanisms.invariant import flying_ring, whirling_crank
from crosscheck.conformance.mechanisms.large_graphs import large_graph
from crosscheck.conformance.mechanisms.moving import dead_end, moving_probes
from crosscheck.conformance.mechanisms.random_scenes import mechanism, with_dampers
from crosscheck.judge.reference.reference import SECONDS
from mbref.scene import Scene
from mbref.scenes import SCENES

SHORT = {  # built-in scenes with a truth, and end times (s) before their first singular position
    "four_bar": 0.01,
    "four_bar_gravity": 0.12,
    "planar_slider_crank": 0.1,
    "spatial_slider_crank": 0.02,
    "spatial_slider_crank_driven": 0.02,
}
DRAWN = {"drawn loop": 0, "drawn driven loop": 1}  # seeds of the random mechanisms that belong to the suite
DAMPED = 8  # seed of the random mechanism with dampers between bodies
GRAPHS = (11, 0, 5)  # seeds of the large mechanisms that belong to the suite, of 13, 31 and 78 bodies
RELATED = (  # scenes to which the metamorphic relations are applied at quick depth
    "pendulum", "torsion", "oscillator", "driven", "turntable", "four_bar_gravity", "spinning loop",
    "cylindrical driver", "force load", "tumbling body", *DRAWN, "drawn damped loop",
)  # fmt: skip


@dataclass(frozen=True)
class Specimen:
    """A scene of the suite. ``exact`` returns its poses if a formula is known. ``related`` applies the
    metamorphic relations. ``reference_time`` is the CPU time (s) of a reference if no closed form exists. A
    ``dead_end`` has drivers that the mechanism cannot follow to the end. A ``large`` mechanism is judged by
    accelerations at the start. ``keeps`` is the quantity that each of the engine's ways keeps on it: momenta
    or energy."""

    scene: Scene
    exact: Exact | None = None
    related: bool = False
    reference_time: float = SECONDS
    dead_end: bool = False
    large: bool = False
    keeps: str = ""


@cache
def specimens(deep: bool = False) -> tuple[Specimen, ...]:
    """Return all scenes of the suite; ``deep`` applies the metamorphic relations to all without couplings."""
    forms = [Specimen(*make(), deep or make.__name__ in RELATED) for make in CLOSED_FORMS]
    scenes = [SCENES[name]().with_(duration=end) for name, end in SHORT.items()]
    features = {n: s.with_(name=n) for n, s in feature_scenes().items() if s.name not in SHORT}
    drawn = [mechanism(seed).with_(name=name) for name, seed in DRAWN.items()]
    drawn.append(with_dampers(mechanism(DAMPED), DAMPED).with_(name="drawn damped loop"))
    scenes += [*(features | moving_probes()).values(), *drawn]
    forms += [Specimen(scene, None, deep or scene.name in RELATED) for scene in scenes]
    geared = [Specimen(*make()) for make in GEARED]
    geared += [Specimen(s.with_(name=n)) for n, s in (coupled_probes() | event_probes()).items()]
    geared.append(Specimen(driven_ball()))
    graphs = (Specimen(large_graph(seed), large=True) for seed in GRAPHS)
    invariant = (Specimen(flying_ring(40.0), keeps="momenta"), Specimen(whirling_crank(), keeps="energy"))
    return (*forms, *geared, Specimen(dead_end(), dead_end=True), *graphs, *invariant)
