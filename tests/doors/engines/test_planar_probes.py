"""Planar probes, loops in a plane that the suite runs on engines that map no joints in space."""

import pytest

from crosscheck.cli.request import find_specimens
from crosscheck.conformance.mechanisms.planar import is_planar, planar_loops
from crosscheck.engine import Cannot, Owner, Supports, engine
from mbref.scene import GROUND, Scene
from tests.helpers.fake_engines import Fake


class Planar(Fake):
    """Maps hinges along z and slides across it, and no load but forces, moments and springs."""

    supports = Supports(("revolute", "translational"), ("angle",), ("force", "moment", "spring"))

    def cannot(self, scene: Scene) -> Cannot | None:
        tilted = [j for j in scene.joint if j.type == "revolute" and tuple(j.axis) != (0.0, 0.0, 1.0)]
        return self.supports.missing(scene) or (Cannot(Owner.ENGINE, "not planar") if tilted else None)


PLANAR = Planar()
ENGINE = "tests.doors.engines.test_planar_probes:PLANAR"


def loops(scene: Scene) -> int:
    """Joints beyond those of a tree that ties every body to the ground."""
    return len(scene.joint) - len(scene.body)


def test_planar_engine_is_run_on_the_loops_of_25_planar_probes():
    """Planar probes are five mechanisms with each of six parts. An engine of hinges along z and slides can
    run those without a torsion spring, 5 · 5, and no loop of others."""
    scenes = [specimen.scene for specimen in find_specimens(None, 0.0, ENGINE)]
    able = [s for s in scenes if PLANAR.cannot(s) is None and loops(s) > 0]
    mapped = {name for name in planar_loops() if not name.endswith("torsion spring")}
    assert {s.name for s in able} == mapped and len(able) == 5 * 5, [s.name for s in able]
    assert len({s.name for s in scenes}) == len(scenes)


@pytest.mark.parametrize("name", ["pinocchio", "mujoco"])
def test_spatial_engine_gets_planar_probes_only_by_name(name):
    """MuJoCo and Pinocchio map joints in space. A request by name gives a planar four-bar with a spring."""
    assert not is_planar(engine(name))
    assert not {s.scene.name for s in find_specimens(None, 0.0, name)} & set(planar_loops())
    assert find_specimens(["planar four-bar: spring"], 0.0, name)[0].scene.load


@pytest.mark.parametrize("name", planar_loops())
def test_planar_probe_is_a_loop_in_the_plane_with_its_named_part(name):
    """A name is "mechanism: part", where the part is a load's type, a driver, or gravity alone."""
    scene = planar_loops()[name]
    assert loops(scene) >= 1 and scene.name == name
    assert {joint.type for joint in scene.joint} <= set(Planar.supports.joints)
    assert all(body.position[2] == 0.0 and body.orientation[1:3] == (0.0, 0.0) for body in scene.body)
    assert any(GROUND in joint.bodies for joint in scene.joint)
    part = name.partition(": ")[2]
    given = [load.type.replace("_", " ") for load in scene.load] + ["driver"] * len(scene.driver)
    assert given == ([] if part == "gravity" else [part]), given
