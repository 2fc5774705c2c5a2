"""All models of an SDF file as one model: nested models and the frames and joints of the world belong to it.

A link, joint or frame of a nested model, or of one of several models, has the name ``model::name``. Every
reference to another frame is written out.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET

from crosscheck.engines.sdf.frames import MODEL, NAMED, WORLD
from mbref.scene import SceneError

STATIC = "static"  # attribute of a link that does not move
IN_MODEL = "in_model"  # attribute of an axis whose direction is given in the frame of the model
FORMATS = ("", "euler_rpy", "quat_xyzw")


def flattened(root: ET.Element) -> ET.Element:
    """Return one model with all links, joints and frames; raises SceneError for a part that is not read."""
    world = root.find("world")
    outside = root if world is None else world
    models = outside.findall("model")
    _refuse_parts(outside, "the world")
    flat = ET.Element("model", name="all")
    is_alone = len(models) == 1 and outside.find("joint") is None and not _names(outside) & _names(models[0])
    writer = _Writer(flat)
    for element in outside:
        if element.tag in ("joint", "frame"):
            writer.add(element, "", WORLD)
    for model in models:
        writer.add_model(model, "", WORLD, is_alone)
    return flat


def _names(element: ET.Element) -> set[str | None]:
    """Return the names of the links, joints, frames and models in a model, or of the frames of a world."""
    tags = ("frame",) if element.tag == "world" else (*NAMED, "model")
    return {part.get("name") for tag in tags for part in element.findall(tag)}


def _refuse_parts(element: ET.Element, where: str) -> None:
    if element.get("placement_frame"):
        raise SceneError([f"{where}: has a placement_frame, which is not read; give the pose of the model"])


class _Writer:
    """Writes copies of elements with full names into one model."""

    def __init__(self, flat: ET.Element):
        self.flat = flat

    def add_model(
        self, model: ET.Element, prefix: str, outer: str, is_alone: bool = False, is_static: bool = False
    ) -> None:
        """Add a model in the frame ``outer``, in which all names begin with ``prefix``."""
        name = prefix + str(model.get("name"))
        _refuse_parts(model, f"model {name!r}")
        inner, frame = ("", MODEL) if is_alone else (f"{name}::", name)
        static = is_static or (model.findtext("static", "").strip().lower() in ("true", "1"))
        own = ET.SubElement(self.flat, "frame", name=frame, attached_to=_main_link(model, inner))
        self._pose(model, own, prefix, outer)
        for element in model:
            if element.tag == "model":
                self.add_model(element, inner, frame, is_static=static)
            elif element.tag in ("link", "joint", "frame"):
                self.add(element, inner, frame, static)

    def add(self, element: ET.Element, prefix: str, frame: str, is_static: bool = False) -> None:
        """Add a link, joint or frame of the model with the frame ``frame``."""
        found = copy.deepcopy(element)
        found.set("name", prefix + str(element.get("name")))
        base = frame
        if element.tag == "link" and is_static:
            found.set(STATIC, "true")
        if element.tag == "joint":
            for side in ("parent", "child"):
                end = found.find(side)
                if end is None or not (end.text or "").strip():
                    raise SceneError([f"joint {found.get('name')!r}: names no {side}"])
                end.text = _full(str(end.text).strip(), prefix, frame)
            base = found.findtext("child", "")
            reference = found.find("gearbox_reference_body")
            if reference is not None:
                reference.text = _full((reference.text or "").strip(), prefix, frame)
            for tag in ("axis", "axis2"):
                self._axis(found.find(tag), prefix, frame)
        if element.tag == "frame":
            given = element.get("attached_to")
            base = _full(given, prefix, frame) if given else frame
            found.set("attached_to", base)
        for pose in found.findall("pose"):
            found.remove(pose)
        self._pose(element, found, prefix, frame, base)
        self.flat.append(found)

    def _pose(
        self, source: ET.Element, target: ET.Element, prefix: str, frame: str, base: str | None = None
    ) -> None:
        """Give an element the pose of another one, relative to a frame with its full name."""
        given = source.find("pose")
        pose = ET.Element("pose") if given is None else copy.deepcopy(given)
        if (form := pose.get("rotation_format", "")) not in FORMATS:
            where = f"{source.tag} {target.get('name')!r}: pose"
            raise SceneError([f"{where}: rotation_format {form!r} is none of {', '.join(FORMATS[1:])}"])
        if given is not None and (frame_of := pose.get("frame")):
            raise SceneError(
                [
                    f"{source.tag} {target.get('name')!r}: pose frame={frame_of!r} has no meaning in SDF 1.5 "
                    "and 1.6; write relative_to, and version 1.7"
                ]
            )
        relative = pose.get("relative_to")
        pose.set("relative_to", _full(relative, prefix, frame) if relative else base or frame)
        target.append(pose)

    def _axis(self, axis: ET.Element | None, prefix: str, frame: str) -> None:
        if axis is None:
            return
        if (xyz := axis.find("xyz")) is None:
            xyz = ET.SubElement(axis, "xyz")
            xyz.text = "0 0 1"  # the default of the format
        if given := xyz.get("expressed_in"):
            xyz.set("expressed_in", _full(given, prefix, frame))
        elif axis.get(IN_MODEL):
            xyz.set("expressed_in", frame)
        mimic = axis.find("mimic")
        if mimic is not None:
            mimic.set("joint", prefix + str(mimic.get("joint")))


def _full(name: str, prefix: str, frame: str) -> str:
    """Return the full name of a frame that a model names."""
    return {WORLD: WORLD, MODEL: frame}.get(name, prefix + name)


def _main_link(model: ET.Element, inner: str) -> str:
    """Return the full name of the link to which the frame of a model is attached."""
    if given := model.get("canonical_link"):
        return inner + given
    for element in model:
        if element.tag == "link":
            return inner + str(element.get("name"))
    nested = model.find("model")
    return WORLD if nested is None else _main_link(nested, f"{inner}{nested.get('name')}::")
