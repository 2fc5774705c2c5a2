"""Scene: a mechanism as validated, frozen data, with its file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from mbref.files import write
from mbref.scene.bodies import OF_POINT, Body, Driver, Turn
from mbref.scene.conditions import Release, When
from mbref.scene.couplings import Coupling
from mbref.scene.fields import Acceleration, EntryType, LaterTime, Name, SceneEntry, Three
from mbref.scene.functions import Factor, Sine, TimeFunction
from mbref.scene.joints import Coordinate, Free, Joint
from mbref.scene.loads import Load
from mbref.scene.paths import replaced_at
from mbref.scene.references import GROUND
from mbref.scene.stops import Stop
from mbref.scene.toml import as_lists, read_toml, scene_text, with_lines
from mbref.scene.validation import SceneError, field_faults, named_paths, reference_faults

ROUNDED_END = 1e-12  # of an end time, by which sums of steps may miss the duration


class Scene(SceneEntry):
    """A mechanism: ``body``, ``joint``, ``coupling``, ``driver`` and ``load`` tuples, gravity and end time.

    ``ground = "body"`` models the ground as a body with six constraint rows, as the paper counts; the default
    ``"frame"`` models no ground body.  Raises SceneError with every fault found.

    Attributes
    ----------
    name : str
        Name of the scene.
    gravity : tuple of 3 float
        Acceleration of gravity, m/s², world frame.
    duration : float
        End time of the motion, s.
    ground : {"frame", "body"}
        Whether the ground is a frame or a body.
    body : tuple of Body
        Rigid bodies, with poses and velocities at t = 0.
    joint : tuple of Joint
        Joints between two bodies, or a body and ``"ground"``.
    coupling : tuple of Coupling
        Linear relations of joint coordinates.
    driver : tuple of Driver
        Prescribed motions of joints; of a point, or in a plane, as motions of joints of type free.
    load : tuple of Load
        Forces, moments, springs and dampers.
    """

    name: Name
    gravity: Three[Acceleration] = (0.0, 0.0, 0.0)
    duration: LaterTime = 1.0
    ground: Literal["frame", "body"] = "frame"
    body: Annotated[tuple[Body, ...], Field(min_length=1)]
    joint: tuple[Joint, ...] = ()
    coupling: tuple[Coupling, ...] = ()
    driver: tuple[Driver, ...] = ()
    load: tuple[Load, ...] = ()

    @model_validator(mode="wrap")
    @classmethod
    def _collect_every_fault(cls, data: Any, handler: Any) -> Scene:
        faults: dict[str, str] = {}
        scene: Scene | None = None
        try:
            scene = handler(data)
        except ValidationError as error:
            for path, message in field_faults(error, FIELDS_OF_TABLES):
                faults.setdefault(path, message)
        if isinstance(data, Mapping):
            for path, message in reference_faults(data):
                faults.setdefault(path, message)
        if faults or scene is None:
            raise SceneError(list(named_paths(data if isinstance(data, Mapping) else {}, faults)))
        scene.__dict__.update(scene._with_free_joints())
        scene.__dict__.update(scene._repeated(scene.duration))
        return scene

    def _with_free_joints(self) -> dict[str, Any]:
        """Return the fields in which driven points, and driven directions of joints, have free joints."""
        if all(driver.along is None for driver in self.driver):
            return {}
        joints, drivers = [*self.joint], []
        for driver in self.driver:
            if driver.along is not None:
                bodies, anchor = (GROUND, driver.body), driver.point
                if driver.point is None:
                    joint = self.joint_named(driver.joint)
                    bodies, (anchor, _) = joint.bodies, joint.anchor_pair
                joints.append(Free(name=driver.name, bodies=bodies, anchor=anchor, axis=driver.along))
            of_joint = {**dict.fromkeys(OF_POINT), "joint": driver.name or driver.joint}
            drivers.append(driver.model_copy(update=of_joint))
        return {"joint": tuple(joints), "driver": tuple(drivers)}

    def _repeated(self, until: float) -> dict[str, Any]:
        """Return the fields in which periodic tables are too short for a time (s), with more periods."""
        found: dict[str, Any] = {}
        driver = tuple(each.repeated(until) for each in self.driver)
        if any(a is not b for a, b in zip(driver, self.driver, strict=True)):
            found["driver"] = driver
        factors = [load.over_time and load.over_time.repeated(until) for load in self.load]
        if any(a is not load.over_time for a, load in zip(factors, self.load, strict=True)):
            found["load"] = tuple(
                load.model_copy(update={"factor": factor}) if factor else load
                for factor, load in zip(factors, self.load, strict=True)
            )
        return found

    def body_index(self, name: str) -> int:
        """Return the index of a body in ``body``.

        Parameters
        ----------
        name : str
            Name of the body, or ``"ground"``.

        Returns
        -------
        int
            The index from 0; -1 for the ground.

        Raises
        ------
        ValueError
            If the scene has no such body.
        """
        return -1 if name == GROUND else [b.name for b in self.body].index(name)

    def joint_named(self, name: str) -> Joint:
        """Return the joint of a name.

        Parameters
        ----------
        name : str
            Name of the joint.

        Raises
        ------
        KeyError
            If the scene has no such joint.
        """
        for joint in self.joint:
            if joint.name == name:
                return joint
        raise KeyError(name)

    def coupled(self, coupling: Coupling) -> tuple[tuple[Joint, Coordinate], ...]:
        """Return the joints of a coupling, each with its coupled coordinate.

        Parameters
        ----------
        coupling : Coupling
            A coupling of this scene.

        Returns
        -------
        tuple of (Joint, str)
            Pairs of a joint and ``"angle"`` (rad) or ``"displacement"`` (m), in the order of ``factors``.
        """
        return coupling.ends(tuple(map(self.joint_named, coupling.joints)))

    def has_mass(self) -> bool:
        """Return whether every body has mass and inertia, as a dynamic analysis needs."""
        return all(body.mass is not None for body in self.body)

    def with_(self, path: str | None = None, value: Any = None, /, **changes: Any) -> Scene:
        """Return a validated copy with some top-level fields replaced, or with another value at a path.

        ``scene.with_(duration=2.0)``, ``scene.with_("body[slider].mass", 2.0)``.

        Parameters
        ----------
        path : str, optional
            Path of a number or another value, such as ``"joint[A].anchor[0]"``.
        value : Any
            The new value at the path, in SI units, or with a unit (``"300 mm"``).
        **changes : Any
            New values of top-level fields.

        Raises
        ------
        SceneError
            If the path does not exist or the copy is no valid scene.
        """
        data = dict(self)
        if path is not None:
            data = replaced_at(data, path, lambda _: value)
        return Scene(**{**data, **changes})

    def reaching(self, end: float) -> Scene:
        """Return a scene whose tables reach an end time beyond its duration: periodic tables repeat.

        Parameters
        ----------
        end : float
            End time, s.

        Raises
        ------
        SceneError
            If a table ends before, beyond which nothing is known.
        """
        is_beyond = end > self.duration * (1 + ROUNDED_END)
        has_table = any(function.table for function in functions_of(self))
        return self.with_(duration=float(end)) if is_beyond and has_table else self

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as the nested tables of its file; fields with default values are left out.

        Returns
        -------
        dict
            Tables, lists, numbers (SI) and text.
        """
        data = self.model_dump(exclude_none=True, exclude_defaults=True)
        for key in ("joint", "load"):
            for item, source in zip(data.get(key, ()), getattr(self, key), strict=True):
                item["type"] = source.type
        lists: dict[str, Any] = as_lists(data)
        return lists

    def save(self, path: str | Path) -> None:
        """Write the scene as TOML; ``Scene.from_file`` returns an equal scene.

        Parameters
        ----------
        path : str or path
            The file.
        """
        write(path, scene_text(self.to_dict()))

    @staticmethod
    def from_file(path: str | Path) -> Scene:
        """Return the scene in a scene file (TOML, UTF-8).

        Parameters
        ----------
        path : str or path
            The file.

        Raises
        ------
        SceneError
            If the file cannot be read or is faulty. The faults name the file, or each faulty field and line.
        """
        text, data = read_toml(path)
        try:
            return Scene(**data)
        except SceneError as error:
            raise SceneError(with_lines(text, error.faults)) from None


def functions_of(scene: Scene) -> list[TimeFunction]:
    """Return the functions of time of a scene: of drivers, then of loads if bodies have masses, then of
    second and third turns of driven orientations."""
    loads = scene.load if scene.has_mass() else ()
    of_drivers = [driver.functions for driver in scene.driver]
    further = [function for functions in of_drivers for function in functions[1:]]
    of_loads = [load.over_time for load in loads if load.over_time]
    return [*(functions[0] for functions in of_drivers), *of_loads, *further]


FIELDS_OF_TABLES = {"": tuple(Scene.model_fields)} | {
    table.__name__.lower(): tuple(table.model_fields)
    for table in (Body, Coupling, Driver, Turn, Sine, Factor, When, Release, Stop)
}


def _refusal(error: ValidationError, fields: Iterable[str]) -> SceneError:
    """Return the faults of an entry with these fields that was made alone."""
    known = {**FIELDS_OF_TABLES, "": tuple(fields)}
    return SceneError([f"{path}: {message}" for path, message in field_faults(error, known)])


EntryType.refusal = _refusal
