"""MJCF files whose meshes and pictures are missing / small specifications, worked out by hand."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from crosscheck.engines.mujoco.importing import meshes
from mbref.scene import SceneError

RULE = SimpleNamespace(mjINERTIAFROMGEOM_FALSE=0, mjINERTIAFROMGEOM_TRUE=1, mjINERTIAFROMGEOM_AUTO=2)
MUJOCO: Any = SimpleNamespace(mjtInertiaFromGeom=RULE)


def asset(file: str, name: str = "") -> Any:
    return SimpleNamespace(file=file, name=name)


def geom(mesh: str = "", field: str = "", **parts: Any) -> Any:
    given = {"mass": math.nan, "density": 1000.0, "group": 0, "material": ""}
    return SimpleNamespace(meshname=mesh, hfieldname=field, **{**given, **parts})


class Spec:
    """A specification, which notes what is deleted."""

    def __init__(self, folder: Path, **parts: Any) -> None:
        self.meshes: list[Any] = []
        self.hfields: list[Any] = []
        self.skins: list[Any] = []
        self.textures: list[Any] = []
        self.bodies: list[Any] = []
        self.materials: list[Any] = []
        self.modelfiledir, self.meshdir, self.texturedir = str(folder), "shapes", "pictures"
        self.compiler = SimpleNamespace(inertiafromgeom=RULE.mjINERTIAFROMGEOM_AUTO, inertiagrouprange=(0, 5))
        self.deleted: list[Any] = []
        self.__dict__.update(parts)

    @property
    def geoms(self) -> list[Any]:
        return [geom for body in self.bodies for geom in body.geoms]

    def delete(self, part: Any) -> None:
        self.deleted.append(part)


def body(*geoms: Any, name: str = "b", explicit: bool = True) -> Any:
    return SimpleNamespace(name=name, geoms=list(geoms), explicitinertial=explicit)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with one mesh and one picture."""
    for name in ("shapes/here.stl", "pictures/wood.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    return tmp_path


def test_assets_whose_files_are_missing_are_deleted_with_their_geoms(folder: Path) -> None:
    """A mesh has the name of its file if it has no name; made assets have no file."""
    gone = [asset("gone.stl"), asset("other.obj", "named"), asset("hill.png", "hill")]
    stay = [asset("here.stl"), asset("", "made"), asset("here.stl", "again")]
    skins = [asset("skin.skn", "s"), asset("here.stl", "kept")]
    pictures = [asset("lost.png", "p"), asset("wood.png", "w"), asset("", "builtin")]
    geoms = [geom("gone"), geom("named"), geom("here"), geom(), geom("", "hill"), geom("made")]
    geoms[3].material, geoms[2].material, geoms[5].material = "painted", "painted", "wooden"
    painted = SimpleNamespace(name="painted", textures=["", "p"])
    wooden = SimpleNamespace(name="wooden", textures=["w"])
    spec = Spec(
        folder,
        meshes=[gone[0], *stay, gone[1]],
        hfields=[gone[2]],
        skins=skins,
        textures=pictures,
        bodies=[body(*geoms)],
        materials=[wooden, painted],
    )
    assert meshes.without_missing(MUJOCO, spec) == [
        "files that are missing: gone.stl, other.obj, hill.png and 2 more; these shapes have no effect"
    ]
    assert spec.deleted == [geoms[0], geoms[1], geoms[4], painted, *gone, skins[0], pictures[0]]
    assert [g.material for g in geoms] == ["", "", "", "", "", "wooden"]


def test_pictures_are_in_their_own_folder(folder: Path) -> None:
    spec = Spec(folder, textures=[asset("here.stl", "p")], meshes=[asset("wood.png", "m")])
    [note] = meshes.without_missing(MUJOCO, spec)
    assert note == "files that are missing: wood.png, here.stl; these shapes have no effect"
    assert meshes.without_missing(MUJOCO, Spec(folder)) == []


@pytest.mark.parametrize(("count", "more"), [(1, ""), (3, ""), (4, " and 1 more"), (5, " and 2 more")])
def test_three_files_are_named(count: int, more: str) -> None:
    names = ["a.stl", "b.stl", "c.stl", "d.stl", "e.stl"][:count]
    assert list(meshes._notes(names)) == [
        f"files that are missing: {', '.join(names[:3])}{more}; these shapes have no effect"
    ]
    assert not list(meshes._notes([]))


@pytest.mark.parametrize(("mesh", "field"), [("gone", ""), ("", "gone")])
def test_a_body_whose_inertia_is_missing_is_refused(folder: Path, mesh: str, field: str) -> None:
    heavy = body(geom("other"), geom(mesh, field), name="arm", explicit=False)
    spec = Spec(folder, **{"meshes" if mesh else "hfields": [asset("gone.stl")]}, bodies=[heavy])
    with pytest.raises(SceneError) as caught:
        meshes.without_missing(MUJOCO, spec)
    assert list(caught.value.faults) == [
        "body 'arm': its inertia follows from the shape 'gone', whose file is missing; "
        f"put the file into {folder / 'shapes'}"
    ]


@pytest.mark.parametrize(
    ("rule", "explicit", "parts", "name", "has"),
    [
        (RULE.mjINERTIAFROMGEOM_FALSE, False, {}, "b", False),
        (RULE.mjINERTIAFROMGEOM_FALSE, True, {}, "b", False),
        (RULE.mjINERTIAFROMGEOM_AUTO, True, {}, "b", False),
        (RULE.mjINERTIAFROMGEOM_AUTO, False, {}, "b", True),
        (RULE.mjINERTIAFROMGEOM_TRUE, True, {}, "b", True),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {}, "b", True),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {}, "world", False),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {"group": 2}, "b", True),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {"group": 4}, "b", True),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {"group": 1}, "b", False),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {"group": 5}, "b", False),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {"mass": 0.0}, "b", False),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {"mass": 2.0, "density": 0.0}, "b", True),
        (RULE.mjINERTIAFROMGEOM_TRUE, False, {"density": 0.0}, "b", False),
    ],
)
def test_geoms_from_which_the_inertia_of_a_body_follows(
    folder: Path, rule: int, explicit: bool, parts: dict[str, Any], name: str, has: bool
) -> None:
    """Geoms of the groups 2 to 4, with a mass of their own or of their density."""
    compiler = SimpleNamespace(inertiafromgeom=rule, inertiagrouprange=(2, 4))
    spec = Spec(folder, compiler=compiler)
    shape = geom("m", **{"group": 3, **parts})
    assert meshes._has_inertia(MUJOCO, spec, body(name=name, explicit=explicit), shape) is has
