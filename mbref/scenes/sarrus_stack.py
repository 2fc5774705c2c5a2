"""N of Sarrus's linkages, each on the platform of the one below: spatial loops with redundant rows.

A linkage has two folding pairs of bars in perpendicular planes and moves its platform along z, so that the
stack has N degrees of freedom.  30 N coordinates, 30 N rows, N of them redundant.
"""

from __future__ import annotations

from mbref.scene import Scene
from mbref.scenes.sarrus import sarrus


def sarrus_stack(count: int = 2, name: str = "sarrus_stack") -> Scene:
    """Return a stack of linkages at rest, under gravity along -z."""
    one = sarrus()
    rise = next(body.position[2] for body in one.body if body.name == "platform")
    bodies, joints = [], []
    for k in range(count):

        def numbered(name: str, k: int = k) -> str:
            """Return the name of a body of this linkage; its ground is the platform below."""
            if name != "ground":
                return f"{name}{k}"
            return f"platform{k - 1}" if k else "ground"

        for body in one.body:
            x, y, z = body.position
            changes = {"name": numbered(body.name), "position": (x, y, z + k * rise)}
            bodies.append(body.model_copy(update=changes))
        for joint in one.joint:
            x, y, z = joint.anchor_pair[0]
            pair = numbered(joint.bodies[0]), numbered(joint.bodies[1])
            changes = {"name": f"{joint.name}_{k}", "bodies": pair, "anchor": (x, y, z + k * rise)}
            joints.append(joint.model_copy(update=changes))
    return Scene(
        name=name, gravity=one.gravity, duration=one.duration, body=tuple(bodies), joint=tuple(joints)
    )
