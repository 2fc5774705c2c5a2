"""The file format that ``mbref import`` and ``mbref export`` find through the entry point mbref.formats:
MJCF, and URDF for reading."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from crosscheck.engines.mujoco.importing.reading import source
from crosscheck.engines.mujoco.original import originals
from crosscheck.engines.mujoco.writing import write
from mbref.formats import Exported, Imported, ImportOptions
from mbref.scene import Scene, SceneError


class MujocoFiles:
    """Files that MuJoCo reads and writes."""

    reads = (".xml", ".urdf")
    writes = (".xml",)

    def read(self, path: Path, options: ImportOptions) -> Imported:
        """Return the scene of a .xml or .urdf file; raises SceneError, ValueError, OSError."""
        _need_mujoco()
        found = source(path, options)
        return replace(found.imported, originals=originals(path, options, found))

    def write(self, scene: Scene) -> Exported:
        """Return the scene as MJCF; raises SceneError if a body has no mass."""
        _need_mujoco()
        return write(scene)


def _need_mujoco() -> None:
    try:
        import mujoco  # noqa: F401
    except ImportError:
        raise SceneError(["MJCF and URDF need MuJoCo: pip install 'mbref[engines]'"]) from None


FORMAT = MujocoFiles()
