"""Gearboxes of SDF: the angles of two links about hinges on a reference link keep a ratio."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np

from mbref import rotations
from mbref.scene import Coupling, Joint, SceneError

PARALLEL = 1e-6  # length of the cross product of unit axes that counts as rounding


def of_gearbox(
    name: str, links: tuple[str, str, str], axes: Sequence[np.ndarray], ratio: float, joints: Sequence[Joint]
) -> Coupling:
    """Return θ₂ = -ratio θ₁ of a gearbox as a coupling of two hinges.

    ``links`` are parent, child and reference; θ₁ is the angle of the parent about the first axis, θ₂ of the
    child about the second axis, both relative to the reference. Raises SceneError if a hinge is missing.
    """
    parent, child, reference = links
    first, sense = _hinge(name, reference, parent, axes[0], joints)
    second, other = _hinge(name, reference, child, axes[1], joints)
    if not ratio:
        raise SceneError([f"joint {name!r}: gearbox_ratio must not be 0"])
    return Coupling(name=name, joints=(first.name, second.name), ratio=-ratio * sense * other)


def _hinge(
    name: str, reference: str, link: str, axis: np.ndarray, joints: Sequence[Joint]
) -> tuple[Joint, int]:
    """Return the hinge between two links along an axis, and 1 or -1: its angle's sense about the axis."""
    for joint in joints:
        if joint.type != "revolute" or set(joint.bodies) != {reference, link}:
            continue
        own = rotations.unit(joint.directions[0])
        if np.linalg.norm(own - (own @ axis) * axis) <= PARALLEL:
            sense = 1 if own @ axis > 0 else -1
            return joint, sense if joint.bodies[0] == reference else -sense
    raise SceneError(
        [f"joint {name!r}: a gearbox needs a hinge along its axis between {reference!r} and {link!r}"]
    )


def reference_of(joint: ET.Element) -> str:
    """Return the name of a gearbox's reference link; raises SceneError if the joint names none."""
    found = joint.findtext("gearbox_reference_body", "").strip()
    if not found:
        raise SceneError([f"joint {joint.get('name')!r}: a gearbox needs gearbox_reference_body"])
    return found
