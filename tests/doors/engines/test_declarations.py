"""Adapters refuse what they do not declare. A joint type has as many rows in all equations."""

from typing import Literal

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.features import BODY, JOINTS
from crosscheck.engine import (
    BUILT_IN,
    ON_REQUEST,
    OPTIONAL,
    Cannot,
    Engine,
    Owner,
    Setting,
    Supports,
    engine,
    installed,
)
from crosscheck.engines.shared.constraint_equations import Constraints
from crosscheck.engines.shared.spanning_tree import spanning_tree
from crosscheck.judge.constraints import initial_poses, jacobian
from mbref.equations.joints import ROWS_OF, primitives_of
from mbref.motions.trajectory import Trajectory
from mbref.scene import HOLONOMIC_JOINTS, Driver, JointFacts, Revolute, Scene, Sine
from mbref.scene.joints import JointEntry
from mbref.scene.loads import LoadEntry

EVERY_ENGINE = (*BUILT_IN, *OPTIONAL, *ON_REQUEST)


class Screw(JointEntry):
    """A joint type that no engine knows."""

    facts = JointFacts((0, 1), (0, 1), driven="angle")
    type: Literal["screw"] = "screw"
    anchor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    anchor_pair = property(lambda self: (self.anchor, self.anchor))
    directions = property(lambda self: (self.axis,))


class Magnet(LoadEntry):
    """A load type that no engine knows."""

    acts_on = "body"
    type: Literal["magnet"] = "magnet"
    body: str = "body"


class Telescopic(Revolute):
    """A hinge whose driver moves a coordinate that no engine knows, "length"."""

    facts = JointFacts((0, 1, 2), (0, 1), driven="length")  # type: ignore[arg-type]


def hinged_body(**parts: tuple) -> Scene:
    """Return a body on hinge J. ``parts`` replace fields unchecked, also by types that no file can have."""
    scene = Scene(name="hinged", body=(BODY,), joint=(JOINTS["revolute"],))
    return scene.model_copy(update=parts)


THREAD = Screw(name="thread", bodies=("ground", "body"))
MAST = Telescopic(name="mast", bodies=("ground", "body"), anchor=(0, 0, 0), axis=(0, 0, 1))
UNKNOWN = {  # a scene with an undeclared part, and words of its refusal
    "joint": (hinged_body(joint=(THREAD,)), ("'thread'", "'screw'")),
    "driven": (hinged_body(joint=(MAST,), driver=(Driver(joint="mast"),)), ("'mast'", "length")),
    "load": (hinged_body(load=(Magnet(),)), ("load[0]", "'magnet'")),
}


@pytest.mark.parametrize("part", UNKNOWN)
@pytest.mark.parametrize("name", EVERY_ENGINE)
def test_an_undeclared_joint_driven_coordinate_or_load_is_refused_by_name(name: str, part: str) -> None:
    """UNKNOWN has a screw, a hinge driven by its length and a magnet, and words of their refusals."""
    scene, words = UNKNOWN[part]
    refusal = engine(name).cannot(scene)
    assert refusal is not None and refusal.owner is Owner.ADAPTER, f"{name}: {refusal}"
    assert all(word in str(refusal) for word in words), refusal


class Bare(Engine):
    """An engine that declares nothing."""

    name, package = "bare", "bare"

    def version(self) -> str:
        return "1"

    def settings(self, scene: Scene) -> list[Setting]:
        return []

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        raise NotImplementedError


def test_an_engine_without_declarations_accepts_a_free_body_and_refuses_a_joint() -> None:
    """Bare is such an engine; the joint is a hinge."""
    assert Bare().cannot(hinged_body(joint=())) is None
    assert isinstance(Bare().cannot(hinged_body()), Cannot)


def test_reason_names_an_undeclared_driver_of_a_declared_joint() -> None:
    """Hinges are declared and their drivers are not: the refusal names hinge 'J' and its driven angle."""
    supports = Supports(joints=("revolute",), loads=("moment",))
    assert supports.missing(hinged_body()) is None
    driven = supports.missing(hinged_body(driver=(Driver(joint="J"),)))
    assert driven is not None and "'J'" in driven.reason and "angle" in driven.reason, driven


@pytest.mark.skipif(not installed("simbody"), reason="simbody is not installed")
def test_simbody_refuses_a_driver_by_polynomial_and_sine_at_once() -> None:
    """OpenSim's functions are one or the other; the refusal names the joint and the engine as the owner."""
    driver = Driver(joint="J", polynomial=(0.0, 1.0), sine=Sine(amplitude=0.1, frequency=3.0))
    refusal = engine("simbody").cannot(hinged_body(driver=(driver,)))
    assert refusal is not None and refusal.owner is Owner.ENGINE and "J" in refusal.reason, refusal


@pytest.mark.parametrize("kind", HOLONOMIC_JOINTS)
def test_a_joint_has_as_many_rows_in_all_equations_as_its_facts_say(kind: str) -> None:
    """``facts.rows`` is 6 less the freedoms: the rows of mbref and adapters, the rank of the judge's
    Jacobian, and 6 less the coordinates of the joint in a tree, where no distance joint is."""
    joint, facts = JOINTS[kind], HOLONOMIC_JOINTS[kind].facts
    scene = Scene(name="one", body=(BODY,), joint=(joint,))
    assert facts.rows + facts.free_translations + facts.free_rotations == 6, facts
    found = {
        "mbref": sum(ROWS_OF[primitive.kind] for primitive in primitives_of(joint)),
        "judge": np.linalg.matrix_rank(jacobian(scene, 0.0, *initial_poses(scene))[0]),
        "adapters": len(Constraints(scene).joint),
    }
    if kind != "distance":
        found["tree"] = 6 - spanning_tree(scene).nv
    assert set(found.values()) == {facts.rows}, f"{kind}: {found}, the facts say {facts.rows}"
