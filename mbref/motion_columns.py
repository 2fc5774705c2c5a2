"""Columns of a motion: all of its numbers over time, by the names of the table of outputs."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbref.outputs import columns_of


def all_columns(motion: Any) -> dict[str, np.ndarray]:
    """Return ``time`` and all columns (k,) of a Motion, by name."""
    scene, table = motion.mechanism, {"time": motion.times}
    for name in motion.bodies:
        table.update(columns_of("body", name, vars(motion[name])))
    for joint in scene.joint:
        table.update(columns_of("joint", joint.name, vars(motion.joint(joint.name))))
    for driver in scene.driver:
        table.update(columns_of("driver", driver.joint, vars(motion.driver(driver.joint))))
    for place in range(len(scene.load)):
        table.update(columns_of("load", str(place), vars(motion.load_at(place))))
    table.update(columns_of("mechanism", "", _totals(motion)))
    return table


def _totals(motion: Any) -> dict[str, np.ndarray | None]:
    """Return the numbers of the whole mechanism by their names in the table of outputs."""
    levels = {f"{level}_violation": rows for level, rows in motion.violation._asdict().items()}
    energies = ("kinetic_energy", "potential_energy", "energy") if motion.mechanism.has_mass() else ()
    found = {name: getattr(motion, name) for name in energies}
    estimate = None if motion.known_estimate is None else motion.known_estimate.error
    return {**levels, "largest_reaction": motion.largest_reaction, **found, "error_estimate": estimate}
