"""The comparison of a scene with its MJCF model / its poses, its order and its limits, worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from crosscheck.engines.mujoco.importing import agreement  # noqa: E402
from crosscheck.engines.mujoco.importing.agreement import Agreement  # noqa: E402
from crosscheck.engines.mujoco.importing.posing import Poses  # noqa: E402
from crosscheck.engines.mujoco.importing.reading import _Reader  # noqa: E402
from mbref.formats import ImportOptions  # noqa: E402
from mbref.scene import Body, Revolute, Scene, SceneError  # noqa: E402

LUMP = '<inertial pos="0.1 0 0" mass="0.5" diaginertia="0.002 0.003 0.004"/>'
FILE = f"""<mujoco><option><flag energy="enable"/></option><worldbody><site name="o" pos="0 0 2"/>
<body name="left" pos="0 0 1"><joint name="A" axis="0 1 0" armature="0.01" damping="0.1"/>{LUMP}
<body name="bar" pos="0.3 0 0"><joint name="B" axis="0 1 0" stiffness="2"/>{LUMP}
<site name="tip" pos="0.6 0 0"/></body></body>
<body name="right" pos="0.8 0 1"><joint name="D" axis="0 1 0" limited="true" range="1 2"/>{LUMP}
<site name="toe" pos="0 0 -0.5"/></body></worldbody>
<equality><connect name="C" site1="tip" site2="toe"/></equality>
<tendon><spatial name="s" stiffness="30"><site site="o"/><site site="tip"/></spatial></tendon></mujoco>"""


class Watched(Agreement):
    """A comparison that notes the poses at which it compares, and a random number at each."""

    def __init__(self, *parts: Any):
        super().__init__(*parts)
        self.poses_seen: list[np.ndarray] = []
        self.numbers: list[float] = []

    def _at_pose(self, scene: Scene, tree: Any, random: np.random.Generator) -> None:
        self.poses_seen.append(self.poses.data.qpos.copy())
        self.numbers.append(random.uniform())
        super()._at_pose(scene, tree, random)


@pytest.fixture(scope="module")
def parts() -> tuple[Any, ...]:
    reader = _Reader(mujoco, mujoco.MjModel.from_xml_string(FILE), None, ImportOptions(), frozenset())
    reader.read()
    return reader.scene("s"), reader.tree, reader.groups, reader.poses


def test_a_scene_is_compared_at_its_pose_and_at_two_closed_poses_near_it(parts: tuple[Any, ...]) -> None:
    scene, tree, groups, poses = parts
    start, bodies = poses.data.qpos.copy(), poses.data.xpos.copy()
    watched = Watched(mujoco, poses.model, groups, poses)
    watched.check(scene, tree)
    assert (poses.data.xpos == bodies).all(), "the bodies stand at the start again"
    first, *others = watched.poses_seen
    assert (first == start).all() and len(others) == 2 and (poses.data.qpos == start).all()
    for seen in others:
        assert 1e-3 < np.abs(seen - start).max() < 1.0
        poses.data.qpos[:] = seen
        poses.place()
        assert max(poses.gaps().values()) < 1e-9
    assert np.ptp(np.array(watched.poses_seen), axis=0).min() > 1e-3, "all poses differ"
    assert watched.numbers[0] == np.random.default_rng(0).uniform(), "the poses are the same in every run"


def test_forces_that_no_scene_has_are_off(parts: tuple[Any, ...]) -> None:
    """Contacts, limits, dry friction and actuators; other flags of the file stay."""
    _, _, groups, poses = parts
    model, bits = poses.model, mujoco.mjtDisableBit
    model.opt.disableflags, model.opt.jacobian = int(bits.mjDSBL_WARMSTART), 1
    made = Agreement(mujoco, model, groups, poses)
    off = (bits.mjDSBL_WARMSTART, bits.mjDSBL_CONTACT, bits.mjDSBL_LIMIT)
    wanted = sum(map(int, (*off, bits.mjDSBL_FRICTIONLOSS, bits.mjDSBL_ACTUATION)))
    assert model.opt.disableflags == wanted and model.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE
    assert (made.mujoco, made.model, made.groups, made.poses) == (mujoco, model, groups, poses)


def test_a_comparison_has_velocities_and_all_forces_of_its_pose(parts: tuple[Any, ...]) -> None:
    """A pose that MuJoCo's data have only the kinematics of: tendons, constraints and velocities follow."""
    scene, tree, groups, poses = parts
    made, data, seen = Agreement(mujoco, poses.model, groups, poses), poses.data, []
    start = data.qpos.copy()
    try:
        assert made._random_pose(start, np.random.default_rng(5))
        made._at_pose(scene, tree, np.random.default_rng(3))
        assert (data.qvel == np.random.default_rng(3).uniform(-1.0, 1.0, 3)).all()
        for name in ("_masses", "_forces", "_tree", "_loops"):
            setattr(made, name, lambda *given, name=name: seen.append((name, given)))
        made._at_pose(scene, tree, np.random.default_rng(3))
        assert [name for name, _ in seen] == ["_masses", "_forces", "_tree", "_loops"]
        (_, masses), (_, forces), (_, joints), (_, loops) = seen
        assert masses == forces and joints == loops and (joints[1], masses[0]) == (tree, scene)
        for given in (masses, joints[:1] + joints[2:]):
            assert given[0] is scene
            assert given[1][0].shape == (3, 3) and given[1][1].shape == (3, 4) and given[2].shape == (18, 3)
    finally:
        data.qpos[:] = start
        poses.place()


class Tried:
    """Poses whose loops close at a given try."""

    def __init__(self, extent: float, closes: int):
        self.extent, self.closes, self.tries, self.placed = extent, closes, 0, 0
        self.data = SimpleNamespace(qpos=np.zeros(3))

    def place(self) -> None:
        self.placed += 1

    def close(self) -> None:
        self.tries += 1
        if self.tries < self.closes:
            raise SceneError(["open"])


@pytest.mark.parametrize(("extent", "reach"), [(4.0, 0.25), (1.0, 0.25), (0.2, 0.05)])
@pytest.mark.parametrize(("closes", "is_found", "tries"), [(1, True, 1), (12, True, 12), (13, False, 12)])
def test_random_poses_are_sought_nearer_and_nearer(
    extent: float, reach: float, closes: int, is_found: bool, tries: int
) -> None:
    """Each of twelve tries begins at the start, within 0.7 of the reach of the try before."""
    made: Any = Agreement.__new__(Agreement)
    made.poses, made.model = Tried(extent, closes), SimpleNamespace(nv=3)
    start, steps = np.array([1.0, 2.0, 3.0]), []

    def integrate(model: Any, qpos: np.ndarray, step: np.ndarray, dt: float) -> None:
        assert model is made.model and (qpos == start).all() and dt == 1.0
        steps.append(step)
        qpos += step

    made.mujoco = SimpleNamespace(mj_integratePos=integrate)
    assert made._random_pose(start, np.random.default_rng(7)) is is_found
    assert made.poses.tries == made.poses.placed == len(steps) == tries
    draws = np.random.default_rng(7)
    for k, step in enumerate(steps):
        assert step == pytest.approx(draws.uniform(-1, 1, 3) * reach * 0.7**k)


def test_loops_are_compared_with_the_rows_of_mujoco(parts: tuple[Any, ...]) -> None:
    """Without own rows of the closure, MuJoCo's rows of the equality are the only ones of the loop."""
    scene, tree, groups, poses = parts
    bare = Poses(mujoco, poses.model, (), (), poses.extent)
    bare.data.qpos[:] = poses.data.qpos
    bare.place()
    Agreement(mujoco, poses.model, groups, bare)._at_pose(scene, tree, np.random.default_rng(2))
    open_chain = scene.with_(joint=[joint for joint in scene.joint if joint.name != "C"])
    with pytest.raises(SceneError, match="loops: the scene's rows have rank 0, the file's 2"):
        Agreement(mujoco, poses.model, groups, bare)._at_pose(open_chain, tree, np.random.default_rng(2))


# --- limits -----------------------------------------------------------------------------------------------
BODIES = tuple(
    Body(name=name, mass=mass, inertia=(2.0, 3.0, 4.0), position=(k, 0.0, 0.0))
    for k, (name, mass) in enumerate((("a", 2.0), ("b", 3.0)))
)
HINGE = Revolute(name="J", bodies=("a", "b"), anchor=(0.5, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
WEIGHTS = Scene(name="s", body=BODIES, joint=(HINGE,), gravity=(0.0, 0.0, -10.0))
POSE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))


def comparison(extent: float = 1.0, mass: Any = None, forces: Any = (0.0, 0.0)) -> Any:
    made: Any = Agreement.__new__(Agreement)
    names = {2: "first", 1: "second"}
    made.model = SimpleNamespace(
        dof_jntid=np.array([2, 1]), joint=lambda j: SimpleNamespace(name=names[j]), jnt_bodyid=[0, 1, 2]
    )
    made.model.nv, made.model.body = 2, lambda b: SimpleNamespace(name="b")
    data = SimpleNamespace(qvel=np.zeros(2), qfrc_bias=np.array(forces), qfrc_passive=np.zeros(2))
    rows = np.zeros((0, 2))
    made.poses = SimpleNamespace(extent=extent, mass=lambda: mass, data=data, jacobian=lambda: rows)
    made.groups = SimpleNamespace(pieces=[0, 1], drift=lambda data, piece: np.zeros(6))
    return made


def test_joints_whose_bodies_have_no_inertia() -> None:
    """Half a rad/s about z has the inertia 0.5² · 4 = 1; a joint that moves nothing has none."""
    turning = np.zeros((12, 2))
    turning[5, 0], turning[6, 1] = 0.5, 0.5
    comparison(mass=np.diag([1.0, 0.75]))._masses(WEIGHTS, POSE, turning)
    with pytest.raises(
        SceneError, match=r"^joint 'first': its bodies have no inertia about or along its axis"
    ):
        comparison(mass=np.zeros((2, 2)))._masses(WEIGHTS, POSE, np.zeros((12, 2)))
    with pytest.raises(SceneError, match="joint 'second': the scene's mass matrix and the file's differ by"):
        comparison(mass=np.diag([1.0, 0.7]))._masses(WEIGHTS, POSE, turning)


def test_rotors_add_inertia_and_forces(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rotors' inertia R and force f: B'(M + R) B in the one comparison, R B'q' - f in the other one."""
    given: list[Any] = []
    rotors = SimpleNamespace(mass=np.diag(np.arange(12.0)), force=10.0 + np.arange(12.0))
    monkeypatch.setattr(agreement, "reflected", lambda *parts: given.append(parts) or rotors)
    moved = np.zeros((12, 2))
    moved[5, 0], moved[6, 1] = 1.0, 2.0
    made = comparison(mass=np.diag([4.0 + 5.0, 4 * (3.0 + 6.0)]))
    made._masses(WEIGHTS, POSE, moved)
    scene, places, turns, velocity, spin = given.pop()
    assert scene is WEIGHTS and places is POSE[0] and turns is POSE[1]
    assert velocity.shape == spin.shape == (2, 3) and not velocity.any() and not spin.any()
    # drifts 3 of a's spin about z and 5 of b's speed along x: (4 + 5) 3 - 15 and 2 ((3 + 6) 5 - 16)
    made = comparison(forces=(12.0, 58.0))
    made.poses.data.qvel[:] = 0.5, 0.25
    drifts = np.zeros((2, 6))
    drifts[0, 5], drifts[1, 0] = 3.0, 5.0
    made.groups.drift = lambda data, piece: drifts[piece] if data is made.poses.data else None
    made._forces(WEIGHTS, POSE, moved)
    scene, places, turns, velocity, spin = given.pop()
    assert scene is WEIGHTS and places is POSE[0] and turns is POSE[1]
    assert velocity.tolist() == [[0, 0, 0], [0.5, 0, 0]] and spin.tolist() == [[0, 0, 0.5], [0, 0, 0]]
    made.poses.data.qfrc_passive[:] = 1.0, 2.0
    with pytest.raises(SceneError, match="bias forces"):
        made._forces(WEIGHTS, POSE, moved)
    made.poses.data.qfrc_bias += 1.0, 2.0
    made._forces(WEIGHTS, POSE, moved)


@pytest.mark.parametrize("gravity", [10.0, 1e-3])
@pytest.mark.parametrize(("off", "is_same"), [(0.9, True), (1.1, False)])
def test_forces_that_cancel_count(gravity: float, off: float, is_same: bool) -> None:
    """a moves by 3 against its weight of 2 g, b by -2 against 3 g: parts of 12 g cancel."""
    moved = np.zeros((12, 2))
    moved[2, 0], moved[8, 0] = 3.0, -2.0
    made = comparison(forces=(off * 1e-8 * 12 * gravity, 0.0))
    scene = WEIGHTS.with_(gravity=(0.0, 0.0, -gravity))
    if is_same:
        made._forces(scene, POSE, moved)
        return
    with pytest.raises(SceneError, match="joint 'first': the scene's bias forces and the file's differ by"):
        made._forces(scene, POSE, moved)


def test_the_limit_of_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quarter of the largest entry, or of larger parts."""
    monkeypatch.setattr(agreement, "AGREE", 0.25)
    made = comparison()
    for ours, theirs in ((4.0, 3.0), (3.0, 4.0), (-0.125, -0.09375), (-4.0, -3.0)):
        made._same(np.array([ours, 0.0]), np.array([theirs, 0.0]), "forces")
        more = theirs - 1e-6 * (ours - theirs)
        with pytest.raises(SceneError, match=r"joint 'first': .* differ by 0\.25 of the largest entry"):
            made._same(np.array([ours, 0.0]), np.array([more, 0.0]), "forces")
    made._same(np.array([0.0, 2.0]), np.array([0.0, 1.0]), "forces", 4.0)
    with pytest.raises(SceneError, match=r"joint 'second': .* differ by 0\.5 of the largest entry"):
        made._same(np.array([0.0, 2.0]), np.array([0.0, 1.0]), "forces", 1.0)
    with pytest.raises(SceneError, match=r"joint 'second': .* differ by 0\.75 of the largest entry"):
        made._same(np.array([[0.0, 0.0], [1.0, 4.0]]), np.array([[0.0, 0.0], [1.0, 1.0]]), "matrix")


@pytest.mark.parametrize(("extent", "limit"), [(0.5, 0.25), (1.0, 0.25), (4.0, 1.0)])
def test_the_limit_of_joints_that_a_file_violates(
    monkeypatch: pytest.MonkeyPatch, extent: float, limit: float
) -> None:
    """A quarter of a metre, or of the extent where it is larger, for gaps and for velocities."""
    monkeypatch.setattr(agreement, "AGREE", 0.25)
    other = Revolute(name="K", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    scene, seen = WEIGHTS.with_(joint=(HINGE, other)), []
    gaps: dict[str, Any] = {}
    rows = np.zeros((2, 12))

    def closure(*given: Any) -> dict[str, Any]:
        seen.append(given)
        return gaps

    monkeypatch.setattr(agreement, "closure", closure)
    monkeypatch.setattr(agreement, "jacobian", lambda *given: seen.append(given) or (rows, None))
    moved = np.eye(12)[:, :11]
    rows[0, 11] = 1.0  # all motions are allowed but the last one, which the file has not
    made = comparison(extent)
    for gap in (np.zeros(0), np.array([limit, 0.0]), np.array([0.0, -limit])):
        gaps = {"J": np.zeros(2), "K": gap}
        made._tree(scene, ["J"], POSE, moved)
    for bare, time, places, turns in seen:
        assert bare.joint == (HINGE,) and time == 0.0 and places is POSE[0] and turns is POSE[1]
    gaps = {"J": np.zeros(2), "K": np.array([0.0, -1.1 * limit])}
    with pytest.raises(SceneError, match=f"joint 'K': the file's motion violates .* by {1.1 * limit:.3g}$"):
        made._tree(scene, ["J"], POSE, moved)
    gaps = {}
    for speed, is_allowed in ((limit, True), (-limit, True), (-1.1 * limit, False)):
        rows[1, 0], rows[1, 11] = speed, 0.0
        with pytest.raises(SceneError, match="allow 10 motions" if is_allowed else "forbid motion"):
            made._tree(scene, ["J"], POSE, moved)
    rows[1] = 0.0
    with pytest.raises(SceneError, match=r"joints allow 11 motions without loops, the file's 10$"):
        made._tree(scene, ["J"], POSE, moved[:, :10])
    rows = np.zeros((0, 12))
    made._tree(scene, [], POSE, np.eye(12))


def test_rows_of_loops_are_compared_at_time_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows along the same direction agree, whatever their lengths are, unless they are too short to count."""
    seen: list[Any] = []
    rows = np.zeros((2, 12))
    rows[0, 3], rows[1, 4] = 2.0, 5e-9
    monkeypatch.setattr(agreement, "jacobian", lambda *given: seen.append(given) or (rows, None))
    moved = np.zeros((12, 2))
    moved[3, 0], moved[4, 1] = 1.0, 1.0
    made = comparison(0.1)
    made._equalities = lambda: np.zeros((0, 2))
    made.poses.jacobian = lambda: np.array([[3.0, 0.0]])
    with pytest.raises(SceneError, match=r"^loops: the scene's rows have rank 2, the file's 1, together 2$"):
        made._loops(WEIGHTS, [], POSE, moved)
    made.poses.extent = 3.0
    made._loops(WEIGHTS, [], POSE, moved)
    rows[1, 4] = 2e-8
    with pytest.raises(SceneError, match="rank 2"):
        made._loops(WEIGHTS, [], POSE, moved)
    made._equalities = lambda: np.array([[0.0, 0.25]])
    made._loops(WEIGHTS, [], POSE, moved)
    for scene, time, places, turns in seen:
        assert scene is WEIGHTS and time == 0.0 and places is POSE[0] and turns is POSE[1]


def test_the_limits_of_independent_and_of_short_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(agreement, "RANK", 0.25)
    assert agreement.rank(np.diag([1.0, 0.25])) == 1 and agreement.rank(np.diag([1.0, 0.250001])) == 2
    assert agreement.rank(np.diag([0.25, 4.0, 1.0])) == 1
    rows = np.array([[0.0, 0.25, 0.0], [0.3, 0.4, 0.0]])
    assert agreement._unit(rows, 0.25) == pytest.approx(np.array([[0.6, 0.8, 0.0]]))


def test_rows_of_equalities_among_all_rows() -> None:
    """Two of three rows belong to equalities; the memory behind the rows is not read."""
    kinds = mujoco.mjtConstraint
    equal, other = int(kinds.mjCNSTR_EQUALITY), int(kinds.mjCNSTR_LIMIT_JOINT)
    made = comparison()
    made.mujoco = mujoco
    made.poses.data = SimpleNamespace(
        nefc=3, efc_type=np.array([equal, other, equal, equal]), efc_J=np.arange(10.0)
    )
    assert made._equalities().tolist() == [[0.0, 1.0], [4.0, 5.0]]
