"""Published benchmark problems: their printed values, their error measures, the accepted errors, and the
sources.

The printed values are data to be checked, not truths: `benchmarks/errata.py` prints how far each is from the
reference.  An observation is one number of a motion at one time. If a problem has no published accepted
error, this project's level OURS applies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge import published_measures as measures
from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.published_measures import Measure
from crosscheck.judge.reference.cache import canonical
from crosscheck.judge.reference.motion import Motion
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from mbref.scenes import find_scene

Observe = Callable[[Scene, Motion | Trajectory], dict[str, float]]
OURS = 1e-6  # accepted error, in the unit of the measure, if none is published


@dataclass(frozen=True)
class Published:
    """One benchmark problem.

    Fields are the scene's name, printed values by name at ``time`` (s), and the function that computes these
    values from a motion sampled at ``times``. ``measure`` computes the error, ``words`` describes it,
    ``acceptance`` is the accepted error, and ``source`` the publication.
    """

    scene: str
    time: float
    samples: int
    values: dict[str, float]
    observe: Observe
    words: str
    measure: Measure
    acceptance: float
    source: str

    @property
    def level(self) -> str:
        """Return the accepted error in words."""
        return f"{self.acceptance:g}" + (
            " (level of this project; none is published)" if self.acceptance == OURS else ""
        )

    def times(self) -> np.ndarray:
        """Return sample times (samples,), dense enough to count the turns of joints."""
        return np.linspace(0.0, self.time, self.samples)

    def deviations(self, motion: Motion) -> dict[str, float]:
        """Return for each name the printed value minus the value of a motion sampled at `times` to the
        end."""
        found = self.observe(find_scene(self.scene), motion)
        return {name: value - found[name] for name, value in self.values.items()}


def _squeezer(scene: Scene, motion: Motion | Trajectory) -> dict[str, float]:
    """Return the seven angles of the test set and their rates, from the hinges' angles."""
    position, orientation = doubles(motion.position), doubles(motion.orientation)
    spin = doubles(motion.angular_velocity)
    angles = constraints.joint_coordinates(scene, motion.times, position, orientation, spin)
    turn = {name: float(angles[name][-1, 0]) for name in angles}
    rate = dict(zip((body.name for body in scene.body), spin[-1, :, 2], strict=True))
    beta, delta, epsilon = (
        STARTS["beta"] + turn["O"],
        STARTS["delta"] + turn["A5"],
        STARTS["epsilon"] + turn["A7"],
    )
    return {
        "beta": beta,
        "Theta": STARTS["Theta"] + turn["F"],
        "gamma": STARTS["gamma"] + turn["B"],
        "Phi": STARTS["Phi"] + turn["G"],
        "delta": delta,
        "Omega": STARTS["Omega"] + turn["H"],
        "epsilon": epsilon,
        "beta'": rate["K1"],
        "Theta'": rate["K2"] - rate["K1"],
        "gamma'": rate["K3"],
        "Phi'": rate["K4"] - rate["K5"],
        "delta'": rate["K5"],
        "Omega'": rate["K6"] - rate["K7"],
        "epsilon'": rate["K7"],
    }


STARTS = {
    "beta": -0.0617138900142764496,
    "Theta": 0.0,
    "gamma": 0.455279819163070380,
    "Phi": 0.222668390165885884,
    "delta": 0.487364979543842550,
    "Omega": -0.222668390165885884,
    "epsilon": 1.23054744454982119,
}


def _top_of_first_upright(scene: Scene, motion: Motion | Trajectory) -> dict[str, float]:
    """Return the position of an upright's upper end, which is twice as far from the pivot as the centre of
    mass."""
    (x, y, _), (vx, vy, _) = 2 * doubles(motion.position[-1, 0]), 2 * doubles(motion.velocity[-1, 0])
    return {"x": x, "y": y, "x'": vx, "y'": vy}


def _slider(scene: Scene, motion: Motion | Trajectory) -> dict[str, float]:
    """Return the height of the slider's centre, and its rate."""
    slider = scene.body_index("slider")
    place, rate = (float(doubles(a[-1, slider, 2])) for a in (motion.position, motion.velocity))
    return {"s": place, "s'": rate}


def _nothing(scene: Scene, motion: Motion | Trajectory) -> dict[str, float]:
    return {}


def _first_top(motion: Trajectory) -> np.ndarray:
    """Return position and velocity (k, 4), in the plane, of the upper end of the first upright."""
    return np.asarray(2 * np.hstack([motion.position[:, 0, :2], motion.velocity[:, 0, :2]]))


ANGLES = ("beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon")
ENERGY = "largest |E(t) - E(0)| (J)"
PLACE = "largest error of the slider's position (m)"
IFTOMM = (
    "M. González et al., Multibody System Dynamics 16, 2006, and the IFToMM library of benchmark problems"
)
CRANK = "IFToMM library, problem 54; Haug 1989, section 12.2"
PUBLISHED: dict[str, Published] = {
    "A01": Published(
        "point_pendulum",
        10.0,
        401,
        {},
        _nothing,
        ENERGY,
        measures.energy,
        5e-5,
        "acceptance: Exudyn, example pendulumIftommBenchmark; problem: " + IFTOMM,
    ),
    "A02": Published(
        "four_bar_chain",
        10.0,
        401,
        {"x": 0.3284573768, "y": 0.9445187937, "x'": 1.423050003, "y'": -0.4948670827},
        _top_of_first_upright,
        "largest relative error of position and velocity of the first top",
        measures.relative_to_each(_first_top),
        1e-3,
        "values: Exudyn, test model fourBarMechanismIftomm, step 0.125 ms; problem: " + IFTOMM,
    ),
    "A03": Published(
        "andrews_squeezer",
        0.03,
        301,
        {
            "beta": 15.81077119629904,
            "Theta": -15.75637105984298,
            "gamma": 0.04082224013073101,
            "Phi": -0.5347301163226948,
            "delta": 0.5244099658805303,
            "Omega": 0.5347301163226948,
            "epsilon": 1.048080741042263,
            "beta'": 1139.920302151208,
            "Theta'": -1424.379294994111,
            "gamma'": 11.03291221937134,
            "Phi'": 19.29337464421385,
            "delta'": 0.5735699284790808,
            "Omega'": -19.29337464421385,
            "epsilon'": 0.3231791658026955,
        },
        _squeezer,
        "largest relative error of the angles at the end",
        measures.relative_at_the_end(_squeezer, ANGLES),
        OURS,
        "Test Set for IVP Solvers, Andrews' squeezing mechanism: PSIDE, tolerance 1e-14",
    ),
    "A04": Published("bricard", 10.0, 401, {}, _nothing, ENERGY, measures.energy, OURS, IFTOMM),
    "A04, thin rods": Published(
        "bricard_thin", 10.0, 401, {}, _nothing, ENERGY, measures.energy, OURS, IFTOMM
    ),
    "A05": Published(
        "flyball_governor",
        10.0,
        401,
        {"s": 0.6196290867, "s'": -0.7476025026},
        _slider,
        "root of the mean square error of the slider's position (m)",
        measures.mean_square_distance("slider"),
        OURS,
        "values: Exudyn 1.13.6 runs its example stiffFlyballGovernorKT, step 0.5 ms; problem: " + IFTOMM,
    ),
    "rigid slider-crank": Published(
        "rigid_slider_crank", 5.0, 401, {}, _nothing, PLACE, measures.distance("slider"), OURS, CRANK
    ),
    "rigid slider-crank, middle": Published(
        "rigid_slider_crank_middle", 5.0, 401, {}, _nothing, PLACE, measures.distance("slider"), OURS, CRANK
    ),
    "heavy top": Published(
        "heavy_top",
        2.0,
        401,
        {},
        _nothing,
        "relative error of the centre's position",
        measures.relative_distance("top"),
        OURS,
        "O. Brüls, A. Cardona, M. Arnold, Mechanism and Machine Theory 48, 2012, 121-137",
    ),
    "Bennett": Published(
        "bennett",
        1.0,
        401,
        {},
        _nothing,
        "largest sum of the angles of opposite hinges (rad)",
        measures.opposite_hinges((("R1", "R3"), ("R2", "R4"))),
        OURS,
        "G. T. Bennett, Engineering 76, 1903",
    ),
    "Sarrus": Published(
        "sarrus",
        0.3,
        401,
        {},
        _nothing,
        "largest departure (m) or tilt (rad) of the platform",
        measures.guided("platform"),
        OURS,
        "P. F. Sarrus, Comptes rendus 36, 1853",
    ),
    "H-frame": Published(
        "h_frame",
        1.0,
        401,
        {},
        _nothing,
        "largest error of the block's position (m)",
        measures.distance("block"),
        OURS,
        "two hinges of one axis, whose reactions are not unique",
    ),
}


def problem_of(scene: Scene) -> Published | None:
    """Return the problem to which a scene belongs, for any duration; None for other scenes."""
    _, problem = BY_SCENE.get(scene.name, ("", None))
    same = problem is not None and canonical(scene) == canonical(find_scene(problem.scene))
    return problem if same else None


BY_SCENE = {problem.scene: (name, problem) for name, problem in PUBLISHED.items()}
