"""Scene: the mechanism as plain, validated, frozen data; reads and writes TOML. The classes here contain no
numerics.

Units are SI, angles radians; positions, axes and velocities are in the world frame at t = 0
unless a field says otherwise.  ``"ground"`` names the fixed frame in fields that name a body. Field names are
equal in Python and in the file, so that the path of a fault (``body[2].mass``) is also the Python expression
of the faulty value.
"""

from __future__ import annotations

from mbref.scene.bodies import Body, Driver, Turn
from mbref.scene.conditions import Release, When
from mbref.scene.couplings import Coupling
from mbref.scene.functions import Factor, Sine, TimeFunction
from mbref.scene.joints import (
    HOLONOMIC_JOINTS,
    JOINT_TYPES,
    Cylindrical,
    Distance,
    Fixed,
    Free,
    Inline,
    Joint,
    JointFacts,
    Planar,
    Revolute,
    Spherical,
    Translational,
    Universal,
)
from mbref.scene.loads import (
    LOAD_TYPES,
    Force,
    JointForce,
    JointLoad,
    JointTorque,
    Load,
    Moment,
    PointDamper,
    RotationalDamper,
    SlideSpring,
    Spring,
    TorsionSpring,
)
from mbref.scene.references import GROUND
from mbref.scene.rolling import Rolling, RollingLine, RollingWheel
from mbref.scene.scene import Scene
from mbref.scene.structure import (
    intermittent,
    refuse_intervals,
    refuse_rolling,
    refuse_turned,
    rolling_wheel,
)
from mbref.scene.validation import SceneError

__all__ = [
    "GROUND",
    "HOLONOMIC_JOINTS",
    "JOINT_TYPES",
    "LOAD_TYPES",
    "Body",
    "Coupling",
    "Cylindrical",
    "Distance",
    "Driver",
    "Factor",
    "Fixed",
    "Force",
    "Free",
    "Inline",
    "Joint",
    "JointFacts",
    "JointForce",
    "JointLoad",
    "JointTorque",
    "Load",
    "Moment",
    "Planar",
    "PointDamper",
    "Release",
    "Revolute",
    "Rolling",
    "RollingLine",
    "RollingWheel",
    "RotationalDamper",
    "Scene",
    "SceneError",
    "Sine",
    "SlideSpring",
    "Spherical",
    "Spring",
    "TimeFunction",
    "TorsionSpring",
    "Translational",
    "Turn",
    "Universal",
    "When",
    "intermittent",
    "refuse_intervals",
    "refuse_rolling",
    "refuse_turned",
    "rolling_wheel",
]
