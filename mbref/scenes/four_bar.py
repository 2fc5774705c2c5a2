"""The paper's four-bar linkage (Figure 3): a rhombus of 0.5 m links in three dimensions.

Revolutes about z at A and D; universals at B and C with z on crank and rocker and, on the coupler, its
transverse in-plane axis (the longitudinal one would leave the coupler free to spin). With ``ground =
"body"``: 24 coordinates, 25 rows with the driver, rank 24, one redundant row.  Rank 23 at θ₂ = nπ: at θ₂ = 0
the folded branch does not meet the branch of a turning crank; at θ₂ = π both meet in a bifurcation. The paper
drives the crank at θ₂ = θ₀ - 124.8 t. The paper gives no inertias; they are chosen here.
"""

from __future__ import annotations

import math

from mbref.scene import Driver, Revolute, Scene, Universal
from mbref.scenes.links import CRANK_RATE, about_z, link

LENGTH = 0.5
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def four_bar(theta0: float = math.pi / 2, name: str = "four_bar") -> Scene:
    """Return the linkage driven at -124.8 rad/s from θ₂ = theta0 (rad)."""
    return driven(parallelogram(theta0, name))


def driven(linkage: Scene) -> Scene:
    """Return the linkage with a driven crank and given rates, which choose the branch if the start is
    singular."""
    turning = {"crank": -CRANK_RATE, "rocker": -CRANK_RATE}
    body = tuple(
        b.model_copy(update={"angular_velocity": (0.0, 0.0, turning.get(b.name, 0.0))}) for b in linkage.body
    )
    driver = Driver(joint="A", polynomial=(0.0, -CRANK_RATE))
    return linkage.with_(body=body, driver=(driver,), duration=0.1)


def four_bar_gravity(theta0: float = 0.3, name: str = "four_bar_gravity") -> Scene:
    """Return the linkage released from rest at θ₂ = theta0 under gravity along -y; the inverted parallelogram
    swings."""
    return parallelogram(theta0, name).with_(gravity=(0.0, -9.81, 0.0), duration=1.0)


def parallelogram(theta0: float, name: str) -> Scene:
    """Return the linkage without driver or load."""
    across = (LENGTH * math.cos(theta0), LENGTH * math.sin(theta0), 0.0)
    a, d = (0.0, 0.0, 0.0), (LENGTH, 0.0, 0.0)
    b, c = across, (LENGTH + across[0], across[1], 0.0)
    return Scene(
        name=name,
        body=(
            link("crank", a, b, about_z(theta0), LENGTH),
            link("coupler", b, c, about_z(0.0), LENGTH),
            link("rocker", d, c, about_z(theta0), LENGTH),
        ),
        joint=(
            Revolute(name="A", bodies=("ground", "crank"), anchor=a, axis=Z),
            Universal(name="B", bodies=("crank", "coupler"), anchor=b, axes=(Z, Y)),
            Universal(name="C", bodies=("coupler", "rocker"), anchor=c, axes=(Y, Z)),
            Revolute(name="D", bodies=("ground", "rocker"), anchor=d, axis=Z),
        ),
    )


def two_rhombi(apart: float, angle: float = 0.3) -> Scene:
    """Return, under gravity, a rhombus whose rocker is the crank of a second rhombus with its frame turned by
    an angle (rad). Both rhombi pass their flat positions within one step.
    """
    first = parallelogram(angle, "two_rhombi")
    x, y = LENGTH * math.cos(apart), LENGTH * math.sin(apart)
    pin = next(joint.anchor_pair[0] for joint in first.joint if joint.name == "C")
    end, foot = (pin[0] + x, pin[1] + y, 0.0), (LENGTH + x, y, 0.0)
    bars = (
        link("coupler2", pin, end, about_z(apart), LENGTH),
        link("rocker2", foot, end, about_z(angle), LENGTH),
    )
    hinges = (
        Revolute(name="E", bodies=("rocker", "coupler2"), anchor=pin, axis=Z),
        Revolute(name="F", bodies=("coupler2", "rocker2"), anchor=end, axis=Z),
        Revolute(name="G", bodies=("ground", "rocker2"), anchor=foot, axis=Z),
    )
    return first.with_(
        gravity=(0.0, -9.81, 0.0), body=(*first.body, *bars), joint=(*first.joint, *hinges), duration=1.0
    )
