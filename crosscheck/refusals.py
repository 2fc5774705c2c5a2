"""Refusals of engines: the features that an adapter supports, and the first feature of a scene that is
missing."""

from __future__ import annotations

import enum
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import wraps
from typing import Any

import numpy as np

from mbref.scene import Scene, intermittent

MOST_COUPLED = 2  # coordinates of a coupling of adapters that do not declare sums
LONGEST_TEXT = 1000  # characters of an engine's message that are kept: about ten lines of a terminal
ORIENTATION = "orientation"  # of a ball joint, which a driver can prescribe
TABLE, FACTOR = "table", "factor"  # features of a driver and of a load


class Owner(enum.Enum):
    """Owner of a missing feature: the part that must change before the scene can run.

    ``ADAPTER`` is crosscheck's adapter of the engine, ``ENGINE`` the engine, and ``MODEL`` the engine's model
    of mechanisms, which excludes the feature.
    """

    ADAPTER = "missing in the adapter"
    ENGINE = "missing in the engine"
    MODEL = "excluded by the engine's model"


@dataclass(frozen=True)
class Cannot:
    """A refusal to simulate a scene, reported before the run.

    Attributes
    ----------
    owner : Owner
        The part that is the cause: adapter, engine, or the engine's model.
    reason : str
        One sentence about the scene, cut after LONGEST_TEXT characters.
    """

    owner: Owner
    reason: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "reason", shortened(self.reason))

    def __str__(self) -> str:
        return f"{self.reason} ({self.owner.value})"


def shortened(text: object) -> str:
    """Return an engine's text, cut after LONGEST_TEXT characters with a note of its length."""
    whole = str(text)
    if len(whole) <= LONGEST_TEXT:
        return whole
    return f"{whole[:LONGEST_TEXT]} … ({len(whole)} characters)"


@dataclass(frozen=True)
class Supports:
    """Features that an adapter maps to its engine.

    Attributes
    ----------
    joints : collection of str
        Joint types, as in scene files.
    drivers, couplings, armatures : collection of str
        Joint coordinates that can be driven, coupled or have an armature: ``"angle"``, ``"displacement"``; a
        driver can also prescribe the ``"orientation"`` of a ball joint.
    loads : collection of str
        Load types, as in scene files.
    over_time : collection of str
        What can follow a function of time beyond polynomial and sine of a driver: ``"table"`` of a driver,
        ``"factor"`` of a load.
    massless_links : bool
        Bodies of mass 0 and inertia 0.
    sums : bool
        Couplings of more than two coordinates.
    powers : int
        Highest power of the first coordinate in a coupling.
    intervals : bool
        Joints and couplings that hold in intervals of time.
    conditions : bool
        Joints and couplings that begin to hold at a value of a coordinate, or that a reaction releases.
    stops : bool
        End stops of joint coordinates.
    """

    joints: Collection[str] = ()
    drivers: Collection[str] = ()
    loads: Collection[str] = ()
    couplings: Collection[str] = ()
    armatures: Collection[str] = ()
    over_time: Collection[str] = ()
    massless_links: bool = False
    sums: bool = False
    powers: int = 1
    intervals: bool = False
    conditions: bool = False
    stops: bool = False

    def missing(self, scene: Scene) -> Cannot | None:
        """Return the refusal of the first joint, coupling, driver or load that is not declared.

        Parameters
        ----------
        scene : Scene
            The mechanism.

        Returns
        -------
        Cannot or None
            None if every feature of the scene is declared.
        """
        missing = next(self._missing(scene), "")
        return Cannot(Owner.ADAPTER, f"{missing}, which the adapter does not map") if missing else None

    def _missing(self, scene: Scene) -> Iterator[str]:
        links = [] if self.massless_links else [body.name for body in scene.body if body.mass == 0]
        yield from (f"body {name!r} is a massless link" for name in links)
        yield from self._missing_events(scene)
        for joint in scene.joint:
            if joint.type not in self.joints:
                yield f"joint {joint.name!r} is of type {joint.type!r}"
            if joint.reflected_inertia and joint.facts.driven not in self.armatures:
                yield f"joint {joint.name!r} has an armature"
        yield from self._missing_of_couplings(scene)
        for driver in scene.driver:
            coordinate = scene.joint_named(driver.joint).facts.driven or ORIENTATION
            if coordinate not in self.drivers:
                yield f"the driver of joint {driver.joint!r} prescribes its {coordinate}"
            if any(function.table for function in driver.functions) and TABLE not in self.over_time:
                yield f"the driver of joint {driver.joint!r} follows a table"
        for k, load in enumerate(scene.load):
            if load.type not in self.loads:
                yield f"load[{k}] is of type {load.type!r}"
            if load.over_time and FACTOR not in self.over_time:
                yield f"load[{k}] changes with time"

    def _missing_events(self, scene: Scene) -> Iterator[str]:
        for path in intermittent(scene):
            if path.endswith(".active") and not self.intervals:
                yield f"{path} has intervals"
            if path.endswith((".when", ".release")) and not self.conditions:
                yield f"{path} is a condition"
        if not self.stops:
            yield from (f"joint {joint.name!r} has an end stop" for joint in scene.joint if joint.end_stop)

    def _missing_of_couplings(self, scene: Scene) -> Iterator[str]:
        for coupling in scene.coupling:
            if coupling.offset:
                yield f"coupling {coupling.name!r} has an offset (mbref.assembled(scene) has none)"
            if len(coupling.joints) > MOST_COUPLED and not self.sums:
                yield f"coupling {coupling.name!r} sums {len(coupling.joints)} coordinates"
            if coupling.powers > self.powers:
                yield f"coupling {coupling.name!r} is a polynomial of degree {coupling.powers}"
            for joint, kind in scene.coupled(coupling):
                if kind not in self.couplings:
                    yield f"coupling {coupling.name!r} couples the {kind} of joint {joint.name!r}"


def within_tables(run: Callable[..., Any]) -> Callable[..., Any]:
    """Return an engine's ``run``, whose scene has periodic tables that reach the last sample. It raises
    SceneError for a table that ends before."""

    @wraps(run)
    def reached(self: Any, scene: Scene, times: np.ndarray, *setting: Any, **named: Any) -> Any:
        return run(self, scene.reaching(max(times, default=0.0)), times, *setting, **named)

    return reached
