"""Joints: type → the function that lists its primitive constraints."""

from mbref.equations.joints import cylindrical, distance, fixed, revolute, spherical, translational, universal

JOINTS = {
    "fixed": fixed.primitives,
    "revolute": revolute.primitives,
    "universal": universal.primitives,
    "spherical": spherical.primitives,
    "translational": translational.primitives,
    "cylindrical": cylindrical.primitives,
    "distance": distance.primitives,
}
