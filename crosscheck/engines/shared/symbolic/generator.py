"""Base of engines that generate code from the symbolic equations of a scene; generating the code counts as
construction."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engine import Cannot, Engine, Owner, Setting, Supports
from crosscheck.engines.shared.file_cache import hashed
from crosscheck.engines.shared.initial_velocities import lacks_mass
from crosscheck.engines.shared.sampling import Counts, Failed, Sample, labels_of, run_through
from crosscheck.engines.shared.symbolic.equations import TreeEquations
from crosscheck.engines.shared.tree_reactions import joint_reactions
from crosscheck.setting import unknown_family
from mbref import rotations
from mbref.motions.trajectory import Cost, Trajectory
from mbref.scene import Scene

JOINTS = ("fixed", "revolute", "universal", "spherical", "translational", "cylindrical", "planar")
RTOL = {"rtol": "relative tolerance"}


@functools.lru_cache(maxsize=4)
def equations_of(scene: Scene) -> TreeEquations:
    """Return the equations of a scene; raises ValueError if they cannot be derived."""
    return TreeEquations(scene)


def origin(scene: Scene, *parts: str) -> str:
    """Return a hash of a scene, of the sources that derive its equations, and of further parts."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return hashed(scene.model_dump_json(warnings=False), *(path.read_text() for path in sources), *parts)


class Generator(Engine):
    """A code generator for trees of slides and turns with loops closed by points, under gravity and
    moments."""

    supports = Supports(joints=JOINTS, loads=("moment",))

    def version(self) -> str:
        """Version of the generator; raises ImportError when it is not installed."""
        return metadata.version(self.package)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse scenes without masses, and scenes whose equations cannot be derived."""
        if found := lacks_mass(scene):
            return found
        try:
            equations_of(scene)
        except ValueError as reason:
            return Cannot(Owner.ADAPTER, f"its equations in joint coordinates are not derived: {reason}")
        return None

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether the family exists; every family can run every scene that is not refused."""
        return family in self.families

    def _known(self, setting: Setting) -> None:
        if setting.family not in self.families:
            raise unknown_family(self.name, setting.family)

    def _trajectory(
        self,
        scene: Scene,
        times: np.ndarray,
        setting: Setting,
        states: np.ndarray,
        failure: Failed | None,
        cost: Cost,
    ) -> Trajectory:
        """Return the trajectory at the reached states (k, 2 n); ``failure`` is the reason for an early
        end."""
        labels = labels_of(self, setting)
        reached = iter(states)

        def advance(_: float, target: float) -> None:
            pass

        def sample(t: float) -> Sample:
            if (found := next(reached, None)) is None:
                raise failure or ValueError(f"{self.name} gave no state at {t:.6g} s")
            return _sample(scene, found)

        found = run_through(scene, times, advance, sample, Counts(), cost.build_seconds, labels)
        return replace(found, cost=cost)


def _sample(scene: Scene, y: np.ndarray) -> Sample:
    """Return poses, velocities and accelerations; reactions are included if no joint of the scene was
    replaced."""
    equations = equations_of(scene)
    motion, closing = equations.link_motion(y)
    own, tree = list(equations.tree.own), equations.tree
    start = np.array([body.orientation for body in scene.body], dtype=float)
    reactions: Mapping[str, Any] = {}
    if equations.has_own_joints:
        reactions = joint_reactions(scene, tree, motion, closing)
    return Sample(
        position=motion.position[own],
        orientation=rotations.multiply(rotations.from_matrix(motion.rotation[own]), start),
        velocity=motion.velocity[own],
        angular_velocity=motion.angular_velocity[own],
        acceleration=motion.acceleration[own],
        angular_acceleration=motion.angular_acceleration[own],
        reactions=dict(reactions),
    )


def sweep(family: str, rtols: Sequence[float], **options: float) -> list[Setting]:
    """Return the settings of a family at the given relative tolerances."""
    return [Setting(family, {"rtol": rtol, **options}) for rtol in rtols]
