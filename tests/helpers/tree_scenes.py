"""Three-dimensional scenes for the tree-based engines: every joint, driver and load kind between them."""

from mbref import rotations
from mbref import scene as kinds
from tests.helpers.parts import Z, hinge, spring

INERTIA = ((0.02, 0.002, -0.001), (0.002, 0.03, 0.003), (-0.001, 0.003, 0.025))


def body(name: str, position: tuple, turned: tuple, mass: float = 1.0, **velocities) -> kinds.Body:
    """A body with a full inertia matrix, turned by a rotation vector."""
    q = tuple(rotations.from_vector(turned).tolist())
    return kinds.Body(name=name, mass=mass, inertia=INERTIA, position=position, orientation=q, **velocities)


BODIES = (
    body("arm7", (0.6, 0.5, 0.3), (0.1, 0.5, -0.2)),
    body("hand", (0.4, 0.9, 0.1), (1.0, 0.2, 0.3)),
    body("root", (0.2, 0.1, 0.0), (0.3, 0.1, 0.9), angular_velocity=(0.0, 0.0, 2.0)),
    body("arm", (0.3, 0.5, 0.2), (0.1, -0.7, 0.3), mass=2.0),
    body("piston", (-0.5, 0.6, 0.4), (0.2, 0.2, 0.2)),
    body("sled", (1.0, 0.8, 0.2), (-0.4, 0.2, 0.1)),
    body("lump", (0.1, -0.2, 0.3), (0.5, 0.6, 0.7)),
)
JOINTS: tuple[kinds.Joint, ...] = (
    kinds.Revolute(name="rev", bodies=("ground", "root"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0)),
    kinds.Spherical(name="sph", bodies=("hand", "arm"), anchor=(0.35, 0.7, 0.2)),
    kinds.Distance(name="dist", bodies=("hand", "piston"), anchors=((0.3, 1.0, 0.2), (-0.4, 0.8, 0.5))),
    kinds.Universal(name="uni", bodies=("arm", "root"), anchor=(0.3, 0.3, 0.1), axes=((1, 0, 1), (1, 1, -1))),
    kinds.Cylindrical(name="cyl", bodies=("piston", "ground"), anchor=(-0.5, 0.5, 0.4), axis=(0.0, 1.0, 0.2)),
    kinds.Translational(name="tra", bodies=("sled", "ground"), anchor=(1.0, 0.5, 0.2), axis=(0.3, 1.0, 0.0)),
    kinds.Fixed(name="fix", bodies=("lump", "root"), anchor=(0.1, 0.0, 0.1)),
    kinds.Universal(name="uni7", bodies=("arm7", "root"), anchor=(0.4, 0.2, 0.1), axes=(Z, (1, -1, 0))),
    kinds.Spherical(name="sph7", bodies=("sled", "arm7"), anchor=(0.8, 0.7, 0.2)),
)
LOADS = (
    spring("sled", (1.0, 0.9, 0.2), "hand", (0.4, 1.0, 0.1), 40.0, 0.4, damping=0.5),
    spring("ground", (0.0, 1.5, 0.0), "arm", (0.3, 0.6, 0.3), 20.0, 0.3),
    kinds.TorsionSpring(joint="cyl", stiffness=3.0, damping=0.1, natural_angle=0.2),
    kinds.Force(body="arm7", point=(0.7, 0.5, 0.5), force=(1.0, -2.0, 3.0)),
    kinds.Moment(body="hand", moment=(0.3, 0.2, -0.1)),
)


def every_joint(**changes) -> kinds.Scene:
    """Seven types of joints (not planar, inline, free), springs, a torsion spring, a force and a moment; two
    loops, one closed by a distance joint, one by a spherical joint."""
    parts = {"body": BODIES, "joint": JOINTS, "load": LOADS}
    return kinds.Scene(name="every_joint", gravity=(0.3, -9.81, 1.0), duration=0.4, **parts).with_(**changes)


def driven() -> kinds.Scene:
    """The scene of `every_joint` with drivers of its cylindrical and its translational joint."""
    sine = kinds.Sine(amplitude=0.3, frequency=9.0)
    return every_joint(
        name="driven",
        body=tuple(b.model_copy(update={"angular_velocity": None}) for b in BODIES),
        driver=(
            kinds.Driver(joint="cyl", polynomial=(0.0, 1.0, -2.0), sine=sine),
            kinds.Driver(joint="tra", polynomial=(0.0, 0.5), sine=kinds.Sine(amplitude=0.05, frequency=7.0)),
        ),
    )


def ring(kind: str) -> kinds.Scene:
    """A four-bar in three dimensions whose last joint, of the given kind, is the one to cut. With a revolute,
    cylindrical, universal or spherical joint the motion is the same planar one, and rows are redundant."""
    last = kinds.JOINT_TYPES[kind].at(
        "C", ("b", "c"), anchor=(0.7, 0.5, 0.0), axis=Z, axes=(Z, (0.0, 1.0, 0.0))
    )
    spin = {"angular_velocity": (0.0, 0.0, 3.0)}
    bodies = (
        kinds.Body(name="a", mass=1.0, inertia=(0.01, 0.02, 0.02), position=(0.0, 0.15, 0.0), **spin),
        kinds.Body(name="b", mass=2.0, inertia=(0.01, 0.05, 0.05), position=(0.35, 0.4, 0.0)),
        kinds.Body(name="c", mass=1.5, inertia=(0.02, 0.01, 0.02), position=(0.7, 0.25, 0.0)),
    )
    left, right = hinge("A", "ground", "a", (0.0, 0.0, 0.0)), hinge("D", "ground", "c", (0.7, 0.0, 0.0))
    parts = {"body": bodies, "joint": (left, hinge("B", "a", "b", (0.0, 0.3, 0.0)), right, last)}
    return kinds.Scene(name=f"ring_{kind}", gravity=(0.0, -9.81, 0.0), duration=0.4, **parts)
