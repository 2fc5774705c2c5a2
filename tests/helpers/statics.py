"""Mechanisms whose equilibria have closed forms."""

from typing import Any

from mbref import Scene
from tests.helpers import parts

G = 9.81
DOWN = (0.0, -G, 0.0)
ORIGIN = (0.0, 0.0, 0.0)


def rod(name: str, place: Any, mass: float = 2.0, inertia: float = 0.3) -> dict[str, Any]:
    """Return a body with three equal moments of inertia."""
    return {"name": name, "mass": mass, "inertia": [inertia] * 3, "position": list(place)}


def hinge(name: str, bodies: Any, anchor: Any = ORIGIN, axis: Any = (0.0, 0.0, 1.0)) -> dict[str, Any]:
    """Return a hinge, by default about the z axis through the origin."""
    return parts.hinge(name, *bodies, anchor, axis)


def slide(name: str, body: str, anchor: Any, axis: Any) -> dict[str, Any]:
    """Return a slide of a body on the ground."""
    return parts.slide(name, "ground", body, anchor, axis)


def pendulum(place: Any = (0.7, 0.0, 0.0), **fields: Any) -> Scene:
    """Return a body of 2 kg, 0.3 kg m², on a hinge at the origin, under gravity."""
    given = {"gravity": DOWN, "body": [rod("rod", place)], "joint": [hinge("A", ("ground", "rod"))]}
    return Scene(name="pendulum", **given | fields)


def parallelogram(sine: float, cosine: float) -> Scene:
    """Return a parallelogram of three links of 1 m on pivots 1 m apart, under gravity 3° from -y. Its crank
    is at the angle from x that has this sine and cosine."""
    x, y = cosine, sine
    cranks = rod("crank", (x / 2, y / 2, 0.0)), rod("rocker", (1.0 + x / 2, y / 2, 0.0))
    bodies = [cranks[0], rod("coupler", (x + 0.5, y, 0.0)), cranks[1]]
    joints = [
        hinge("A", ("ground", "crank")),
        hinge("B", ("crank", "coupler"), (x, y, 0.0)),
        hinge("C", ("coupler", "rocker"), (1.0 + x, y, 0.0)),
        hinge("D", ("ground", "rocker"), (1.0, 0.0, 0.0)),
    ]
    return Scene(name="parallelogram", gravity=(0.5, -G, 0.0), body=bodies, joint=joints)


def ball_linkage(ends: tuple[str, str] = ("spherical", "spherical")) -> Scene:
    """Return a spatial four-bar without gravity: two cranks on hinges, of which one is tilted, and a coupler
    between joints of two types."""
    bodies = [rod("crank", (0, 0.25, 0.0)), rod("coupler", (0.5, 0.5, 0.1)), rod("rocker", (1.0, 0.25, 0.1))]
    places = ((0.0, 0.5, 0.0), (1.0, 0.5, 0.2))
    tilted = hinge("D", ("ground", "rocker"), (1.0, 0.0, 0.0), (0.1, 0.0, 1.0))
    joints, pairs = [hinge("A", ("ground", "crank")), tilted], (("crank", "coupler"), ("coupler", "rocker"))
    for name, kind, pair, place in zip("BC", ends, pairs, places, strict=True):
        axes = {"axes": [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]} if kind == "universal" else {}
        joints.append({"name": name, "type": kind, "bodies": list(pair), "anchor": list(place), **axes})
    return Scene(name="ball_linkage", body=bodies, joint=joints)
