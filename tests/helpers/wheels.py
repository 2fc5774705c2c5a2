"""Wheels of a small engine in several versions, in a folder that pip reads instead of an index."""

from __future__ import annotations

import zipfile
from pathlib import Path

PACKAGE, ENGINE = "falling-engine", "falling_engine:ENGINE"
SOURCE = """
import numpy as np

from crosscheck.engine import Engine, Setting, Trajectory


class Options:
    step = {step}


{more}


def adapter():
    import falling_engine

    return falling_engine.fall


class Falling(Engine):
    name = "falling"
    package = "falling-engine"
    defaults_of = ("falling_engine.Options()",)

    def settings(self, scene):
        return [Setting("plain", {{"step": 1e-3}})]

    def run(self, scene, times, setting):
        change = {factor} * np.tile(scene.gravity, (len(times), len(scene.body), 1))
        t, still = times[:, None, None], 0.0 * change
        return Trajectory(
            scene.name, self.name, self.version(), setting.family, dict(setting.options), times,
            tuple(body.name for body in scene.body),
            change * t**2 / 2 + [body.position for body in scene.body],
            np.tile([1.0, 0.0, 0.0, 0.0], (len(times), len(scene.body), 1)),
            change * t, still, change, still,
        )


ENGINE = Falling()
"""
FALL = "def fall():\n    pass"


def write_wheel(folder: Path, version: str, factor: float = 1.0, step: float = 0.1, more: str = FALL) -> None:
    """Write the wheel of a version whose bodies fall with ``factor`` times the gravity."""
    named, info = f"falling_engine-{version}", f"falling_engine-{version}.dist-info"
    files = {
        "falling_engine.py": SOURCE.format(factor=factor, step=step, more=more),
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {PACKAGE}\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    files[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in [*files, f"{info}/RECORD"])
    with zipfile.ZipFile(folder / f"{named}-py3-none-any.whl", "w") as wheel:
        for name, text in files.items():
            wheel.writestr(name, text)
