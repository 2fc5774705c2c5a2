"""Models that an SDF file includes by a path or ``model://name``, written in place of each ``<include>``."""

from __future__ import annotations

import copy
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path

from crosscheck.engines.sdf.elements import is_true
from crosscheck.engines.sdf.flattening import IN_MODEL
from crosscheck.engines.shared import xml_files
from crosscheck.engines.shared.xml_files import DEEPEST
from mbref.files import content
from mbref.scene import SceneError

VARIABLES = ("SDF_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH")
SCHEMES = ("model://", "file://", "package://")
CONFIGURATION, MODEL_FILE = "model.config", "model.sdf"
AXES_IN_MODEL = (1, 4)  # last version whose axes are given in the frame of the model
EXPRESSED_IN = (1, 7)  # first version whose axes name their frame, in place of use_parent_model_frame
GRAVITY_OF_WORLD = (1, 6)  # first version whose gravity is in the world, not in its physics
OVERRIDES = ("pose", "static")
STILL = ("sun", "ground_plane", "asphalt_plane")  # models of Gazebo's library in which nothing moves


def expanded(root: ET.Element, file: Path) -> ET.Element:
    """Return a copy with the included models in place of all includes, and gravity where version 1.6 has it;
    raises SceneError, OSError.

    Includes of STILL are removed. Another model is looked for beside the file, in the two folders above it,
    and in the folders of VARIABLES.
    """
    found = copy.deepcopy(root)
    state_frame_of_axes(found)
    _move_gravity(found)
    _expand(found, (file.resolve(),))
    return found


def state_frame_of_axes(root: ET.Element) -> None:
    """Write into each axis whether it is given in the frame of the model, by its file's version; versions
    from 1.7 on have no element for it."""
    version = _version(root)
    if version >= EXPRESSED_IN:
        return
    for axis in (axis for tag in ("axis", "axis2") for axis in root.iter(tag)):
        given = axis.find("use_parent_model_frame")
        if is_true(given) or (given is None and version <= AXES_IN_MODEL):
            axis.set(IN_MODEL, "true")
        if given is not None:
            axis.remove(given)


def _move_gravity(root: ET.Element) -> None:
    """Move the gravity of the physics into the world in files before version 1.6."""
    world = root.find("world")
    if world is None or _version(root) >= GRAVITY_OF_WORLD:
        return
    for physics in world.findall("physics"):
        if (gravity := physics.find("gravity")) is not None:
            physics.remove(gravity)
            if world.find("gravity") is None:
                world.append(gravity)


def _version(root: ET.Element, where: str = "") -> tuple[int, ...]:
    try:
        return tuple(int(word) for word in root.get("version", "").split("."))
    except ValueError:
        raise SceneError([f"{where}version {root.get('version')!r}: is no version of SDF"]) from None


def _expand(element: ET.Element, files: tuple[Path, ...], depth: int = 1) -> None:
    """Replace the includes of an element and its parts; ``files`` includes the file of the element last."""
    if depth > DEEPEST:
        raise SceneError([f"{files[-1]}: models are nested more than {DEEPEST} deep, with their includes"])
    for part in element.findall("include"):
        if part.findtext("uri", "").strip().rpartition("/")[2] in STILL:
            element.remove(part)
    for k, part in enumerate(list(element)):
        if part.tag == "include":
            element[k] = _included(part, files, depth)
        elif part.tag in ("world", "model"):
            _expand(part, files, depth + 1)


def _included(include: ET.Element, files: tuple[Path, ...], depth: int) -> ET.Element:
    uri = include.findtext("uri", "").strip()
    if include.get("merge", "false").lower() in ("true", "1"):
        raise SceneError([f"include {uri!r}: merge='true' is not read; give the model a name of its own"])
    if include.find("placement_frame") is not None:
        raise SceneError([f"include {uri!r}: placement_frame is not read; give the pose of the model"])
    if any(part.tag.endswith("params") for part in include):
        raise SceneError([f"include {uri!r}: experimental:params is not read; change the model's own file"])
    path = _file_of(uri, files[-1].parent)
    if path in files:
        raise SceneError([f"include {uri!r}: {path} includes itself"])
    root = xml_files.parsed_bytes(content(path), f"include {uri!r}: {path}")
    model = root.find("model")
    if model is None:
        raise SceneError([f"include {uri!r}: {path} has no model"])
    state_frame_of_axes(root)
    model.set("name", include.findtext("name", "").strip() or str(model.get("name")))
    for tag in OVERRIDES:
        if (given := include.find(tag)) is not None:
            for own in model.findall(tag):
                model.remove(own)
            model.append(given)
    model.extend(part for part in include if part.tag not in ("uri", "name", *OVERRIDES))
    _expand(model, (*files, path), depth + 1)
    return model


def _file_of(uri: str, folder: Path) -> Path:
    """Return the SDF file of an address; raises SceneError that names every place without the model."""
    scheme = next((s for s in SCHEMES if uri.startswith(s)), "")
    if not uri or (not scheme and "://" in uri):
        raise SceneError([f"include {uri!r}: is no path, file:// or model://; download the model first"])
    name, tried = uri.removeprefix(scheme), []
    for place in _places(folder):
        path = place / name
        tried.append(str(path))
        if path.is_dir():
            path = path / _main_file(path)
        if path.is_file():
            return path.resolve()
    raise SceneError(
        [
            f"include {uri!r}: is none of {', '.join(tried)}; put the model beside the file, "
            f"or name its folder in {VARIABLES[0]} or {VARIABLES[1]}"
        ]
    )


def _places(folder: Path) -> Iterator[Path]:
    yield from (folder, *_above(folder))
    for variable in VARIABLES:
        yield from (Path(word) for word in os.environ.get(variable, "").split(os.pathsep) if word)


def _above(folder: Path, most: int = 2) -> Sequence[Path]:
    """Return the folders above, since models include models that lie beside their own folder."""
    return folder.parents[:most]


def _main_file(folder: Path) -> str:
    """Return the file of the newest version that a model's configuration names."""
    configuration = folder / CONFIGURATION
    if not configuration.is_file():
        return MODEL_FILE
    root = xml_files.parsed(configuration)
    found = [(_version(sdf, f"{configuration}: "), (sdf.text or "").strip()) for sdf in root.findall("sdf")]
    if any(not name for _, name in found):
        raise SceneError([f"{configuration}: <sdf> names no file"])
    return max(found, default=((), MODEL_FILE))[1]
