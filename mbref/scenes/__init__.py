"""The built-in mechanisms: name → function that returns the Scene."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from mbref.scene import Scene, SceneError
from mbref.scene.fields import meant
from mbref.scenes.andrews_squeezer import andrews_squeezer
from mbref.scenes.bennett import bennett
from mbref.scenes.bricard import bricard
from mbref.scenes.five_bar import five_bar, five_bar_gravity
from mbref.scenes.flyball_governor import flyball_governor
from mbref.scenes.four_bar import four_bar, four_bar_gravity
from mbref.scenes.four_bar_chain import four_bar_chain
from mbref.scenes.h_frame import h_frame
from mbref.scenes.heavy_top import heavy_top
from mbref.scenes.lattice import lattice
from mbref.scenes.planar_slider_crank import (
    planar_slider_crank,
    planar_slider_crank_equal,
    planar_slider_crank_gravity,
    planar_slider_crank_heavy,
)
from mbref.scenes.point_pendulum import point_pendulum
from mbref.scenes.rigid_slider_crank import rigid_slider_crank
from mbref.scenes.sarrus import sarrus
from mbref.scenes.sarrus_stack import sarrus_stack
from mbref.scenes.slider_crank_chain import slider_crank_chain
from mbref.scenes.spatial_slider_crank import (
    spatial_slider_crank,
    spatial_slider_crank_driven,
    spatial_slider_crank_gravity,
)
from mbref.scenes.strandbeest import strandbeest

SCENES: dict[str, Callable[[], Scene]] = {
    "four_bar": four_bar,
    "four_bar_quarter": partial(four_bar, math.pi / 4, "four_bar_quarter"),
    "four_bar_straight": partial(four_bar, math.pi, "four_bar_straight"),
    "four_bar_gravity": four_bar_gravity,
    "five_bar": five_bar,
    "five_bar_gravity": five_bar_gravity,
    "spatial_slider_crank": spatial_slider_crank,
    "spatial_slider_crank_driven": spatial_slider_crank_driven,
    "spatial_slider_crank_gravity": spatial_slider_crank_gravity,
    "planar_slider_crank": planar_slider_crank,
    "planar_slider_crank_equal": planar_slider_crank_equal,
    "planar_slider_crank_heavy": planar_slider_crank_heavy,
    "planar_slider_crank_gravity": planar_slider_crank_gravity,
    "four_bar_chain": four_bar_chain,
    "slider_crank_chain": slider_crank_chain,
    "point_pendulum": point_pendulum,
    "andrews_squeezer": andrews_squeezer,
    "bricard": bricard,
    "bricard_thin": partial(bricard, True, "bricard_thin"),
    "flyball_governor": flyball_governor,
    "rigid_slider_crank": rigid_slider_crank,
    "rigid_slider_crank_middle": partial(rigid_slider_crank, True, "rigid_slider_crank_middle"),
    "heavy_top": heavy_top,
    "bennett": bennett,
    "sarrus": sarrus,
    "h_frame": h_frame,
}

OTHER_FILES = (".xml", ".urdf", ".sdf")  # suffixes of MJCF, URDF and SDF files


class Family(NamedTuple):
    """Scenes of any size: function of the sizes and the name, number of sizes, loops for each unit of
    size."""

    make: Callable[..., Scene]
    sizes: int
    loops: int


# four_bar_chain[40], lattice[6,4]
FAMILIES = {
    "four_bar_chain": Family(four_bar_chain, 1, 1),
    "slider_crank_chain": Family(slider_crank_chain, 1, 1),
    "lattice": Family(lattice, 2, 1),
    "strandbeest": Family(strandbeest, 1, 3),
    "sarrus_stack": Family(sarrus_stack, 1, 1),
}

MOST_LOOPS = 10_000  # 130 000 constraint rows of a chain; more take minutes to prepare, and several GB


def find_scene(name: Scene | str | Path) -> Scene:
    """Return a built-in scene, the scene in a file, or a scene that is given itself.

    Parameters
    ----------
    name : Scene, str or path
        A name in SCENES, a family with its size (``four_bar_chain[40]``, ``lattice[6,4]``), the path of a
        .toml file, or a scene.

    Raises
    ------
    SceneError
        If there is no such scene or file, or the file is faulty.
    """
    if isinstance(name, Scene):
        return name
    name = str(name)
    if name in SCENES:
        return SCENES[name]()
    family = re.fullmatch(r"(\w+)(?:\[([1-9]\d*(?:,[1-9]\d*)*)\])?", name)
    if family and family[1] in FAMILIES:
        return _of_size(family[1], family[2].split(",") if family[2] else [], name)
    if Path(name).suffix in OTHER_FILES:
        makes = f"`mbref import {name}` makes one, and `crosscheck compare {name}` reads it as it is"
        raise SceneError([f"{name}: is no scene file; {makes}"])
    if name and Path(name).exists():
        return Scene.from_file(name)
    if name.endswith(".toml"):
        raise SceneError([_missing(Path(name))])
    names = dict.fromkeys((*SCENES, *FAMILIES))
    known = f"built-in: {', '.join(names)}; or a .toml file"
    raise SceneError([f"unknown scene {name!r}; {known}{meant(name, names)}"])


def _of_size(family: str, sizes: list[str], name: str) -> Scene:
    """Return a scene of a family with the given numbers, by default the smallest scene that shows its
    structure."""
    make, count, loops = FAMILIES[family]
    if len(sizes) not in (0, count):
        form = f"{family}[{','.join('NM'[:count])}]"
        raise SceneError([f"{name:.80}: must have its size in brackets, {form}"])
    digits = len(str(MOST_LOOPS))
    if any(len(size) > digits for size in sizes) or loops * math.prod(map(int, sizes)) > MOST_LOOPS:
        raise SceneError([f"{name:.80}: must have at most {MOST_LOOPS} loops"])
    return make(*map(int, sizes), name=name)


def _missing(path: Path) -> str:
    """Return the sentence on a missing scene file, with the file or scene that was probably meant."""
    if path.stem in SCENES:
        return f"{path}: no such file; without .toml {path.stem!r} is a built-in scene"
    here = [str(other) for other in path.parent.glob("*.toml")]
    return f"{path}: no such file{meant(str(path), here)}"
