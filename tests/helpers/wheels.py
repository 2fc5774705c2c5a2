"""Wheels of `falling_engine` in several versions, in a folder that pip reads instead of an index."""

import zipfile
from pathlib import Path

PACKAGE, ENGINE = "falling-engine", "falling_engine:ENGINE"
SOURCE = (Path(__file__).parent / "falling_engine.py").read_text()


def write_wheel(folder, version, factor=1.0, step=0.1, fall="fall"):
    """Write the wheel of a version with these constants and this name of its function."""
    named, info = f"falling_engine-{version}", f"falling_engine-{version}.dist-info"
    text = SOURCE.replace("FACTOR, STEP = 1.0, 0.1", f"FACTOR, STEP = {factor}, {step}")
    files = {
        "falling_engine.py": text.replace("def fall(", f"def {fall}("),
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {PACKAGE}\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    files[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in [*files, f"{info}/RECORD"])
    with zipfile.ZipFile(folder / f"{named}-py3-none-any.whl", "w") as wheel:
        for name, content in files.items():
            wheel.writestr(name, content)
