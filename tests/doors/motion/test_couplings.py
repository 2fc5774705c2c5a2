"""Couplings of two and more joints: closed forms of sums, the judge, engines, rows, faults, pictures."""

import numpy as np
import pytest

import mbref
from crosscheck.engine import Setting, engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.gauss_principle import gauss, stacked
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref import Scene, SceneError
from mbref.cli import main
from mbref.scene import JOINT_TYPES
from tests.helpers.coupled_mechanisms import body, gear_pair, pendulum, planetary
from tests.helpers.parts import X, Y, Z, hinge, slide

TIMES = np.linspace(0.0, 2.0, 9)
G = 9.81
INERTIAS, TORQUES = np.array([0.1, 0.3, 0.2]), np.array([0.3, 0.0, 2.0])  # kg m² and N m of A, B, C
RATIOS = np.array([1.0, 1.0, -2.0])
CLOSE = 1e-10  # rad and m of angles up to 20 rad


def differential(**changes) -> Scene:
    """Two shafts and the cage of a differential, on fixed axes: φ_A + φ_B = 2 φ_C."""
    bodies, joints, loads = [], [], []
    for k, (name, inertia, torque) in enumerate(zip("abc", INERTIAS.tolist(), TORQUES.tolist(), strict=True)):
        bodies.append(body(name, 1.0, [inertia] * 3, (k, 0.0, 0.0)))
        joints.append(hinge(name.upper(), "ground", name, (k, 0.0, 0.0)))
        loads.append({"type": "moment", "body": name, "moment": [0.0, 0.0, torque]})
    gears = [{"name": "gears", "joints": ["A", "B", "C"], "ratios": RATIOS.tolist()}]
    parts = {"duration": 2.0, "body": bodies, "joint": joints, "coupling": gears, "load": loads}
    return Scene(name="differential", **parts | changes)


def hoist() -> Scene:
    """Two weights on a rope over a drum: x_A + x_C = r φ_B, r = 50 mm, a row in m as its last coordinate."""
    places = {"left": (-1.0, 0.0, 0.0), "drum": (0.0, 1.0, 0.0), "right": (1.0, 0.0, 0.0)}
    masses = {"left": (3.0, 0.1), "drum": (2.0, 0.02), "right": (1.0, 0.1)}  # kg, kg m²
    bodies = [body(name, masses[name][0], [masses[name][1]] * 3, at) for name, at in places.items()]
    makers = zip("ABC", (slide, hinge, slide), places.items(), (Y, Z, Y), strict=True)
    joints = [maker(joint, "ground", name, at, axis) for joint, maker, (name, at), axis in makers]
    rope = {"name": "rope", "joints": ["A", "B", "C"], "ratios": [1.0, "-50 mm/rad", 1.0]}
    return Scene(name="hoist", gravity=(0, -G, 0), duration=1.0, body=bodies, joint=joints, coupling=[rope])


CASES = {  # maker; masses, forces (the weights of a hoist) and ratios of the three coordinates
    "differential": (differential, INERTIAS, TORQUES, RATIOS),
    "hoist": (hoist, np.array([3.0, 0.02, 1.0]), np.array([-3 * G, 0.0, -G]), np.array([1.0, -0.05, 1.0])),
}


def accelerations(masses, forces, ratios):
    """Return q̈ of m q̈ + ratios λ = f, Σ ratios q̈ = 0, and the forces -ratios λ of the coupling."""
    share = (ratios * forces / masses).sum() / (ratios**2 / masses).sum()
    return (forces - ratios * share) / masses, -ratios * share


@pytest.mark.parametrize("method", ["taylor", "alf-dual+projection/dop853", "lm1+none"])
@pytest.mark.parametrize("name", CASES)
def test_coordinates_that_a_coupling_sums_move_by_their_closed_form(name, method):
    """Coordinates are q̈ t² / 2, and the reactions along them are the forces of the coupling, both by
    ``accelerations``. Forces and closures are exact to 1e-9, 1000 times rtol."""
    make, masses, forces, ratios = CASES[name]
    scene = make()
    motion = mbref.simulate(scene, method, TIMES, rtol=1e-12)
    q, force = accelerations(masses, forces, ratios)
    for k, (joint, kind) in enumerate(scene.coupled(scene.coupling[0])):
        found = motion.joint(joint.name)
        assert getattr(found, kind) == pytest.approx(q[k] * TIMES**2 / 2, abs=CLOSE)
        along = found.moment[:, 2] if kind == "angle" else found.force[:, 1]
        assert along == pytest.approx(force[k], rel=1e-9)
    assert motion.violation.position.max() < 1e-9


@pytest.mark.parametrize("name", CASES)
def test_both_formulations_of_the_reference_have_the_closed_form(name):
    """Each coordinate moves by q̈ t² / 2 (rad or m), in the rotations and places of both, to rounding."""
    make, masses, forces, ratios = CASES[name]
    scene, (q, _) = make(), accelerations(masses, forces, ratios)
    for found in (natural_motion(scene, TIMES, EXTENDED), tree_motion(scene, TIMES, EXTENDED, seconds=100.0)):
        assert not found.reason
        position, p = doubles(found.position), doubles(found.orientation)
        for k, (_, kind) in enumerate(scene.coupled(scene.coupling[0])):
            half = q[k] * TIMES**2 / 4
            if kind == "angle":
                exact = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
                assert np.abs(np.abs((exact * p[:, k]).sum(axis=1)) - 1).max() < 1e-13
            else:
                assert position[:, k, 1] - position[0, k, 1] == pytest.approx(2 * half, abs=1e-13)


def test_driven_shafts_of_a_differential_turn_its_cage_by_the_mean():
    """The cage turns by the mean of 3 t and -5 t, over full turns. By virtual work each driver holds half of
    the cage's torque, 2 N m, and A also the torque on its own shaft; nothing is accelerated."""
    drivers = [{"joint": "A", "polynomial": [0.0, 3.0]}, {"joint": "B", "polynomial": [0.0, -5.0]}]
    motion = mbref.simulate(differential(driver=drivers), times=TIMES * 5)
    assert motion.joint("C").angle == pytest.approx(-5 * TIMES, abs=CLOSE)
    assert motion.driver("A").torque == pytest.approx(-TORQUES[2] / 2 - TORQUES[0], abs=CLOSE)
    assert motion.driver("B").torque == pytest.approx(-TORQUES[2] / 2, abs=CLOSE)


def test_offset_of_a_sum_is_met_by_the_least_displacement():
    """Σ I φ² is least under Σ r φ = 0.03 rad, r the ratios: Lagrange's φ = 0.03 (r / I) / Σ (r² / I). Linear
    steps in quaternions are right to the order φ², 1e-4 for 0.01 rad."""
    scene = differential(load=[]).with_("coupling[gears].offset", "0.03 rad")
    motion = mbref.simulate(scene, times=[0.0, 1.0])
    found = np.array([motion.joint(n).angle[0] for n in "ABC"])
    assert found @ RATIOS == pytest.approx(0.03, abs=1e-12)  # rad
    assert found == pytest.approx(0.03 * RATIOS / INERTIAS / (RATIOS**2 / INERTIAS).sum(), rel=1e-4)


def test_sum_along_skew_axes_of_a_chain_has_the_judges_accelerations():
    """The coupling sums angles and displacements of joints between moving bodies. At the start Gauss's
    principle of the judge is the truth. At 0.3 s the energy (J) is the same to 1e-9, 1000 times rtol, and
    joints are closed to rounding (m)."""
    bodies = [body(name, 1.0, [0.1, 0.12, 0.14], (k + 0.3, 0.1 * k, 0.2)) for k, name in enumerate("abcd")]
    joints = [
        hinge("A", "ground", "a", (0.0, 0.0, 0.0), (0.0, 0.6, 0.8)),
        slide("B", "a", "b", (1.0, 0.0, 0.0), (1.0, 0.0, 0.5), armature=0.3),
        hinge("C", "b", "c", (2.0, 0.0, 0.0), (1.0, 1.0, 0.0)),
        slide("D", "c", "d", (3.0, 0.0, 0.0), X),
    ]
    coupling = [{"name": "sum", "joints": list("ABCD"), "ratios": [0.3, 1.0, -0.7, 0.4]}]
    scene = Scene(name="chain", gravity=(1, -9, 3), body=bodies, joint=joints, coupling=coupling)
    motion = mbref.simulate(scene, times=[0.0, 0.3], rtol=1e-12)
    exact = gauss(scene)
    assert np.abs(stacked(scene, motion, 0) - exact).max() < 1e-10 * np.abs(exact).max()
    assert motion.energy[1] == pytest.approx(motion.energy[0], abs=1e-9)
    assert motion.violation.position.max() < 1e-12


@pytest.mark.parametrize(
    ("name", "family", "options"), [("simbody", "merson", {"accuracy": 1e-9}), ("dart", "terms", {})]
)
def test_engine_that_sums_coordinates_moves_a_differential_by_its_closed_form(name, family, options):
    """The cage's rate is q̈ t, to 1e-7 rad/s: a hundred times Simbody's accuracy."""
    pytest.importorskip({"simbody": "opensim", "dart": "dartpy"}[name])
    runner, scene = engine(name), differential()
    *_, finest = (s for s in runner.settings(scene) if s.family == family)
    motion = runner.run(scene, TIMES, Setting(family, {**finest.options, **options}))
    q, _ = accelerations(INERTIAS, TORQUES, RATIOS)
    found = mbref.Motion.of(scene, motion).joint("C").rate
    assert found == pytest.approx(q[2] * TIMES, abs=1e-7)


@pytest.mark.parametrize("name", ["mujoco", "exudyn", "pinocchio"])
def test_engine_that_couples_pairs_refuses_a_sum_by_name(name):
    """The gears relate three angles; these engines couple two coordinates at most."""
    refusal = engine(name).supports.missing(differential())
    assert "coupling 'gears' sums 3 coordinates" in str(refusal)


def test_sum_is_left_out_of_exported_mjcf_with_a_note(tmp_path, capsys):
    """MJCF's equalities relate two joints: of two couplings the pair stays."""
    pair = {"name": "pair", "joints": ["A", "B"], "ratio": 2.0}
    differential(coupling=[*differential().to_dict()["coupling"], pair]).save(tmp_path / "scene.toml")
    assert main(["export", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "scene.xml")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "coupling gears: an equality of MJCF relates two joints, not 3" in said
    assert 'name="pair"' in (tmp_path / "scene.xml").read_text()


AT_MOST_NINE = "numbers, such as [0.0, 6.0], of a coupling at most nine, got [1, 1, 1, 1, 1, 1, ...]"
NO_SLIDE = "is revolute, which has no displacement to be coupled"
PAIR = {"name": "teeth", "joints": ["A", "B"], "ratio": -0.5}
PAIR_FAULTS = [
    ({"joints": ["A", "C"]}, "joints[1]: unknown joint 'C'; known: A, B"),
    ({"joints": ["A", "A"]}, f"joints: 'A' {NO_SLIDE}"),
    ({"ratio": 0.0}, "ratio: must not be 0, which would lock the second joint"),
    ({"coordinates": ["angle", "displacement"]}, f"joints: 'B' {NO_SLIDE}"),
    ({"name": "A"}, "name: 'A' is already the name of a joint"),
    ({"joints": ["A"]}, "joints: must be two or more names of joints, got ['A']"),
    ({"polynomial": [1.0, 2.0]}, "polynomial: or ratio, not both"),
    ({"ratio": None, "polynomial": [1.0, 0.0]}, "polynomial: must not end with 0, which has no influence"),
    ({"ratio": None, "polynomial": [1.0, "2 m"]}, "polynomial[1]: is in rad/rad^2, got '2 m'"),
    ({"ratio": None, "polynomial": [1] * 10}, f"polynomial: must be {AT_MOST_NINE}"),
    ({"ratoi": 1.0}, "ratoi: is not a known field; did you mean 'ratio'?"),
]
SUM = {"name": "gears", "joints": ["A", "B", "C"], "ratios": RATIOS.tolist()}
SUM_FAULTS = [
    ({"ratios": [1.0, 1.0]}, "ratios: must be 3, one for each joint, got 2"),
    ({"ratios": None, "ratio": 1.0}, "ratio: relates two joints; 3 joints need ratios, one for each"),
    ({"ratios": None}, "ratios: is required"),
    ({"ratios": [1.0, 0.0, 1.0]}, "ratios: must not be 0, which would leave out its joint"),
    ({"ratios": [1.0, 1.0, 1.0], "ratio": 2.0}, "ratios: or ratio, not both"),
    ({"joints": ["A", "B", "A"]}, f"joints: 'A' {NO_SLIDE}"),
    ({"ratios": [1.0, "1 m/rad", 1.0]}, "ratios[1]: is in rad/rad, got '1 m/rad'"),
    ({"coordinates": ["angle"]}, "coordinates: must be 3, one for each joint, got 1"),
]


@pytest.mark.parametrize(
    ("make", "entry", "change", "fault"),
    [
        *((gear_pair, {"name": "teeth", "joints": ["A", "B"], "ratio": -0.5}, *each) for each in PAIR_FAULTS),
        *(
            (differential, {"name": "gears", "joints": [*"ABC"], "ratios": RATIOS.tolist()}, *each)
            for each in SUM_FAULTS
        ),
    ],
)
def test_fault_of_a_coupling_is_named_by_its_field(make, entry, change, fault):
    """A right coupling, of two hinges or of three, gets one change, which is the only fault reported; None
    removes a field. AT_MOST_NINE and NO_SLIDE are the rest of a sentence."""
    changed = {k: v for k, v in (entry | change).items() if v is not None}
    with pytest.raises(SceneError) as found:
        make(coupling=[changed])
    assert found.value.faults == [f"coupling[{changed['name']}].{fault}"]


def test_counts_list_the_rows_of_couplings_and_rotors():
    """A hinge has 5 rows; an armature is a rotor, a body of its own, held by 6; a coupling has 1."""
    counts = mbref.diagnose(planetary()).counts
    assert counts.rows_by_joint == {"A": 5, "B": 5, "armature of A": 6, "armature of B": 6, "mesh": 1}
    assert counts.degrees_of_freedom == 1


@pytest.mark.parametrize(
    ("kind", "coordinate"),
    [
        ("revolute", "angle"),
        ("cylindrical", "angle"),
        ("planar", "angle"),
        ("translational", "displacement"),
        ("inline", "displacement"),
    ],
)
def test_coupling_takes_the_angle_of_a_joint_that_has_one_and_otherwise_the_displacement(kind, coordinate):
    """The pinion of the gear pair gets a joint of each type; the coupling states no coordinates."""
    axle = JOINT_TYPES[kind].at("A", ("ground", "disc"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    scene = gear_pair()
    scene = scene.with_(joint=(axle.model_copy(update={"bodies": scene.joint[0].bodies}), scene.joint[1]))
    assert [end for _, end in scene.coupled(scene.coupling[0])] == [coordinate, "angle"]


def test_drawing_shows_a_coupling_as_a_dotted_line():
    """The SVG of a gear pair has strokes of dashes of 1 px in gaps of 5 px; that of a pendulum has none."""
    assert 'stroke-dasharray="1 5"' in mbref.still(gear_pair())
    assert 'stroke-dasharray="1 5"' not in mbref.still(pendulum())
