"""Constraint equations of engines' adapters, of mbref and of the judge describe equal constraints. The three
sets share no code, and their rows differ. At states that meet the constraints, all have equal row spaces,
ranks and least-norm accelerations."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag

from crosscheck.engines.shared.constraint_equations import Constraints, frames
from crosscheck.engines.shared.generalised_forces import Forces
from crosscheck.engines.sundials.equations import Equations
from crosscheck.judge import constraints
from mbref import rotations
from mbref.equations.model import Model
from mbref.scene import HOLONOMIC_JOINTS, JOINT_TYPES, Body, Distance, Driver, Scene, Sine, Universal
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, ROUNDING
from tests.helpers.tree_scenes import driven, every_joint, ring
from tests.helpers.truth_scenes import ALL, CLOSED

coordinate = st.floats(-1, 1, allow_subnormal=False)
vectors = st.tuples(coordinate, coordinate, coordinate)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 0.1)
quaternions = (
    st.tuples(coordinate, coordinate, coordinate, coordinate)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: tuple((np.array(q) / np.linalg.norm(q)).tolist()))
)
DRIVABLE = tuple(kind for kind in JOINT_TYPES.values() if kind.facts.driven)


@st.composite
def bodies(draw, name: str) -> Body:
    """A body with mass, anywhere."""
    moments = np.array(draw(st.tuples(*[st.floats(0.1, 1)] * 3)))
    inertia = tuple((moments + moments.sum()).tolist())  # meets the triangle inequality
    mass = draw(st.floats(0.1, 10))
    position, orientation = draw(vectors), draw(quaternions)
    return Body(name=name, mass=mass, inertia=inertia, position=position, orientation=orientation)


@st.composite
def joints(draw, kind: type, pair: tuple[str, str]):
    """A joint of that kind between two bodies."""
    common = {"name": "J", "bodies": pair}
    if kind is Distance:
        first = draw(vectors)
        second = tuple((np.array(first) + np.array(draw(directions))).tolist())
        return Distance(**common, anchors=(first, second))
    if kind is Universal:
        axis, other = np.array(draw(directions)), np.array(draw(directions))
        across = np.cross(axis, other)
        if np.linalg.norm(across) < 0.05:
            across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        return Universal(**common, anchor=draw(vectors), axes=(tuple(axis.tolist()), tuple(across.tolist())))
    if "axis" not in kind.model_fields:
        return kind(**common, anchor=draw(vectors))
    return kind(**common, anchor=draw(vectors), axis=draw(directions))


@st.composite
def one_joint_scenes(draw, kind: type, driven: bool) -> Scene:
    """Two bodies, or a body and the ground, with one joint and perhaps its driver."""
    pair = draw(st.sampled_from([("ground", "b"), ("b", "ground"), ("b", "c")]))
    names = [name for name in pair if name != "ground"]
    joint = draw(joints(kind, pair))
    rates = draw(st.tuples(coordinate, coordinate))
    sine = Sine(amplitude=draw(coordinate), frequency=draw(st.floats(0.5, 3)))
    driver = Driver(joint="J", polynomial=(0.0, *rates), sine=sine)
    drawn = tuple(draw(bodies(name)) for name in names)
    return Scene(name="one joint", body=drawn, joint=(joint,), driver=(driver,) if driven else ())


SPACES = 2.1e-14  # measured difference of projections on row spaces, whose entries are at most 1
ACCELERATIONS = 8e-13  # measured difference, over 1 + the largest acceleration
KINDS = tuple(HOLONOMIC_JOINTS.values())
MECHANISMS = {scene.name: scene for scene in (every_joint(), driven(), ring("revolute"), ring("universal"))}
# without the chain, whose redundant rows lead Newton's method from disturbed states to a singular position
MECHANISMS |= {name: SCENES[name]() for name in CLOSED if name != "four_bar_chain"}
RANK = 1e-8  # of the largest singular value; poses are consistent to 1e-14


class Consistent:
    """A random state at time t that meets the constraints: r, p, v, spin in body axes (omega) and world axes
    (w). It is the start, disturbed by ``far`` (m, rad) and projected."""

    def __init__(self, scene: Scene, t: float, seed: int, far: float):
        rng = np.random.default_rng(seed)
        self.scene, self.t, nb = scene, t, len(scene.body)
        equations = Equations(scene)
        r, p = constraints.initial_poses(scene)
        r = r + far * rng.normal(size=(nb, 3))
        p = rotations.multiply(p, rotations.from_vector(far * rng.normal(size=(nb, 3))))
        twist = rng.normal(size=6 * nb)
        y = np.concatenate([r.ravel(), p.ravel(), twist, np.zeros(equations.springs)])
        s = equations.state(equations.projected(t, y))
        self.r, self.p, self.v, self.omega = s.r, s.p, s.v, s.omega
        self.a = rotations.to_matrix(s.p)
        self.w = rotations.rotate(s.p, s.omega)
        self.frames = s.frames()
        self.to_body = block_diag(*(block_diag(np.eye(3), a.T) for a in self.a))

    def polynomials(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Φ, Jacobian by world twists, and γ, of the constraint polynomials."""
        c = Constraints(self.scene)
        phi, _, bias = c.levels(self.t, self.frames)
        return phi, c.jacobian(self.t, self.frames) @ self.to_body, -bias

    def terms_of_mbref(self):
        """mbref's terms in principal frames, and the matrix (6 nb, 6 nb) from world twists to theirs."""
        model = Model(self.scene)
        start = np.array([body.orientation for body in self.scene.body])
        principal = rotations.multiply(rotations.conjugate(start), model.orientation)
        p = rotations.multiply(self.p, principal)
        spin = rotations.rotate(rotations.conjugate(p), self.w)
        terms = model.terms(self.t, np.hstack([self.r, p]).ravel(), np.hstack([self.v, spin]).ravel())
        return terms, block_diag(*(block_diag(np.eye(3), a.T) for a in rotations.to_matrix(p)))

    def mbref(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Constraint values, their Jacobian to world twists (rows, 6 nb), and γ, of mbref's model."""
        terms, back = self.terms_of_mbref()
        return terms.phi, terms.jacobian @ back, terms.gamma

    def judge(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Constraint values, their Jacobian to world twists (rows, 6 nb), and γ, of the judge's equations."""
        place = (self.scene, self.t, self.r, self.p)
        still = np.zeros_like(self.r)
        phi = constraints.closure(*place)
        bias = constraints.closure_accelerations(*place, self.v, self.w, still, still)
        none = np.zeros(0)
        residuals, biases = (np.concatenate([none, *of.values()]) for of in (phi, bias))
        return residuals, constraints.jacobian(*place)[0], -biases


class Differences(NamedTuple):
    """Largest differences of three sets of constraints, in a state that closes them."""

    phi: float  # |Φ|
    spaces: float  # of the projections on the row spaces of the Jacobians J, from the polynomials'
    accelerations: float  # of the least-norm solutions of J a = γ, over 1 + the largest one


def differences(state: Consistent) -> Differences:
    """Compare polynomials, mbref's model and the judge's joint equations."""
    sets = {"polynomials": state.polynomials(), "mbref": state.mbref(), "judge": state.judge()}
    spaces, accelerations = {}, {}
    for name, (_, jacobian, gamma) in sets.items():
        _, sizes, rows = np.linalg.svd(jacobian)
        rank = int(np.sum(sizes > RANK * sizes.max(initial=0)))
        spaces[name] = rows[:rank].T @ rows[:rank]
        accelerations[name] = np.linalg.lstsq(jacobian, gamma, rcond=RANK)[0]
    scale = 1 + np.abs(accelerations["polynomials"]).max(initial=0)
    pairs = [[of[name] - of["polynomials"] for name in ("mbref", "judge")] for of in (spaces, accelerations)]
    off = [max(np.abs(each).max(initial=0) for each in pair) for pair in pairs]
    return Differences(max(np.abs(phi).max(initial=0) for phi, _, _ in sets.values()), off[0], off[1] / scale)


@pytest.mark.parametrize("name", MECHANISMS)
@pytest.mark.parametrize("seed", [1, 2])
def test_polynomials_mbref_and_judge_have_equal_constraints_of_mechanisms(name: str, seed: int) -> None:
    """The adapters' polynomials, mbref and the judge agree 0.02 m and rad from the start: residuals are below
    1e-13; row spaces and least-norm accelerations within ten times the measured 2.1e-14 and 8e-13."""
    found = differences(Consistent(MECHANISMS[name], 0.001 * seed, seed, 0.02))
    assert found.phi < MARGIN * ROUNDING and found.spaces < MARGIN * SPACES
    assert found.accelerations < MARGIN * ACCELERATIONS


@pytest.mark.parametrize("kind", KINDS)
@given(data=st.data())
def test_polynomials_mbref_and_judge_have_equal_constraints_of_random_joints(kind, data):
    """The adapters' polynomials, mbref and the judge agree on a joint that may be driven: residuals are below
    1e-13; row spaces and least-norm accelerations within ten times the measured 2.1e-14 and 8e-13."""
    is_driven = kind in DRIVABLE and data.draw(st.booleans())
    scene = data.draw(one_joint_scenes(kind, is_driven))
    found = differences(Consistent(scene, data.draw(st.floats(0, 0.3)), data.draw(st.integers(0, 99)), 0.1))
    assert found.phi < MARGIN * ROUNDING and found.spaces < MARGIN * SPACES
    assert found.accelerations < MARGIN * ACCELERATIONS


@pytest.mark.parametrize("name", ["every_joint", "driven", "five_bar", "spatial_slider_crank_driven"])
def test_derivatives_of_constraint_polynomials_are_difference_quotients(name: str) -> None:
    """Φ' and Φ'' are central differences of Φ and Φ' over 2 h, along a motion with constant v and body-fixed
    ω. The difference, over 1 + the largest derivative, is at most ten times the measured 1.7e-7."""
    scene, h = MECHANISMS[name], 1e-6
    s = Consistent(scene, 0.002, 7, 0.02)
    c = Constraints(scene)

    def at(dt: float) -> np.ndarray:
        p = rotations.multiply(s.p, rotations.from_vector(dt * s.omega))
        return c.levels(s.t + dt, frames(s.r + dt * s.v, p, s.v, s.omega))

    levels, before, after = at(0.0), at(-h), at(h)
    for k in (0, 1):  # Φ', Φ''
        quotient = (after[k] - before[k]) / (2 * h)
        assert abs(quotient - levels[k + 1]).max() / (1 + abs(levels[k + 1]).max()) < MARGIN * 1.7e-7


@pytest.mark.parametrize("name", ["every_joint", "planar_slider_crank_gravity", "crank_torsion"])
def test_generalised_forces_of_adapters_equal_mbrefs(name: str) -> None:
    """Gravity, loads and gyroscopic moments (6 nb,) in world axes. Adapters and mbref share no code here;
    mbref's bodies have principal frames. They differ by rounding, 1e-13 of the largest. In crank_torsion a
    torsion spring acts between two bodies that move."""
    scene = ALL[name] if name in ALL else MECHANISMS[name]
    s = Consistent(scene, 0.0, 3, 0.02)
    forces = Forces(scene)
    angles = np.array([forces.angle(s.frames, k) for k in range(len(forces.twists))])
    of_adapters = s.to_body.T @ forces(s.frames, s.omega, angles)
    terms, back = s.terms_of_mbref()
    of_mbref = back.T @ terms.force
    assert abs(of_adapters - of_mbref).max() / abs(of_mbref).max() < MARGIN * ROUNDING
