"""Event: a time at which joints or couplings begin or cease to constrain a motion, or at an end stop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from mbref.motions.record_fields import typed

STATE_BEFORE = ("position", "orientation", "velocity", "angular_velocity")
NAME_LISTS = ("engaged", "released", "stops", "contacts", "chatter")
# impulse of force / impulse of moment, 1/m, below which it is rounding
ROUNDED_IMPULSE = 1e-12
EVENT_STATES = (*STATE_BEFORE, "velocity_after", "angular_velocity_after")


@dataclass(frozen=True, eq=False)
class Event:
    """A time at which joints or couplings begin or cease to constrain, and the impact there.

    Attributes
    ----------
    time : float
        s.
    engaged, released : tuple of str
        Names of the joints and couplings that begin and cease to constrain, and of stops that are left.
    position, orientation : ndarray, shape (nb, 3) and (nb, 4)
        Centres of mass (m) and unit quaternions (w, x, y, z) of the nb bodies, world frame.
    velocity, angular_velocity : ndarray, shape (nb, 3)
        Velocities before the event, world frame, m/s and rad/s.
    velocity_after, angular_velocity_after : ndarray, shape (nb, 3)
        Velocities after the event.
    angles : mapping of str to float
        By joint that always holds and turns about one axis: angle since t = 0, rad, full turns counted.
    impulses : mapping of str to ndarray, shape (6,)
        By joint that constrains after the event: impulse of force (N s) and of moment (N m s) on its second
        body at its anchor, world frame.
    open : mapping of str to int
        By joint: number of components of its impulse that redundant constraints leave open. The impulses then
        have the least norm.
    energy_before, energy_after : float
        Kinetic energy, J, with the rotors of armatures. Moving drivers do work.
    stops : tuple of str
        End stops that coordinates meet, such as ``"A.upper"``.
    contacts : tuple of str
        End stops at which coordinates stay after the event.
    chatter : tuple of str
        End stops at which bounces end, because the next one would last less than 1e-6 of the end time.
    """

    time: float
    engaged: tuple[str, ...]
    released: tuple[str, ...]
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    velocity_after: np.ndarray
    angular_velocity_after: np.ndarray
    angles: Mapping[str, float]
    impulses: Mapping[str, np.ndarray]
    open: Mapping[str, int]
    energy_before: float
    energy_after: float
    stops: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    chatter: tuple[str, ...] = ()

    @property
    def jumps(self) -> bool:
        """True if velocities jump: constraints begin to hold, or stops are met."""
        return bool(self.engaged or self.stops)

    @property
    def sentence(self) -> str:
        """Names of constraints, change of the kinetic energy, and the joint with the largest impulse."""
        several = len(self.engaged) > 1, len(self.released) > 1
        begin, end = "begin to hold" if several[0] else "begins to hold", "are" if several[1] else "is"
        parts = [f"{', '.join(self.engaged)} {begin}"] if self.engaged else []
        parts += [f"{', '.join(self.released)} {end} released"] if self.released else []
        together = "are met at once" if len(self.stops) > 1 else "is met"
        parts += [f"{', '.join(self.stops)} {together}"] if self.stops else []
        parts += [f"contact at {', '.join(self.contacts)}"] if self.contacts else []
        parts += [f"bounces end at {', '.join(self.chatter)}"] if self.chatter else []
        if self.jumps:
            lost = self.energy_before - self.energy_after
            change = f"{lost:.6g} J lost" if lost >= 0.0 else f"{-lost:.6g} J supplied by drivers"
            parts.append(f"kinetic energy {self.energy_before:.6g} J → {self.energy_after:.6g} J, {change}")
        if self.jumps and self.impulses:
            sizes = {
                unit: {
                    name: float(np.linalg.norm(wrench[k : k + 3])) for name, wrench in self.impulses.items()
                }
                for unit, k in (("N s", 0), ("N m s", 3))
            }
            force, moment = (max(each.values()) for each in sizes.values())
            unit = "N s" if force > ROUNDED_IMPULSE * moment else "N m s"
            name = max(sizes[unit], key=lambda each: sizes[unit][each])
            parts.append(f"largest impulse {sizes[unit][name]:.6g} {unit} in joint {name}")
        if self.jumps and any(self.open.values()):
            parts.append("redundant constraints leave impulses open, the least are given")
        return "; ".join(parts)

    def to_record(self) -> dict[str, Any]:
        """Return the event as numbers, lists and text, for JSON.

        Returns
        -------
        dict
            The attributes by name, in their units; arrays are nested lists.
        """
        found = {each.name: getattr(self, each.name) for each in fields(self)}
        found |= {key: found[key].tolist() for key in EVENT_STATES}
        found["impulses"] = {name: wrench.tolist() for name, wrench in self.impulses.items()}
        names = {key: list(found[key]) for key in NAME_LISTS}
        return {**found, **names, "angles": dict(self.angles), "open": dict(self.open)}

    @staticmethod
    def from_record(record: Mapping[str, Any]) -> Event:
        """Return the event that ``to_record`` wrote.

        Parameters
        ----------
        record : mapping
            Result of ``to_record``.

        Returns
        -------
        Event
            The event, with arrays as attributes.
        """
        arrays = {key: np.array(record[key], dtype=float) for key in EVENT_STATES}
        impulses = {name: np.array(wrench, dtype=float) for name, wrench in record["impulses"].items()}
        names = {key: tuple(record.get(key, ())) for key in NAME_LISTS}
        return typed(Event(**{**record, **arrays, **names, "impulses": impulses}))
