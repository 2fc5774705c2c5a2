"""Files of other programs, tables and folders of records: valid ones, and ones that are damaged at random."""

import json
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

MJCF = """<mujoco model="{name}"><worldbody><body name="rod" pos="0 0 1">
<joint name="a" type="hinge" axis="0 1 0" armature="0.1" damping="0.2"/>
<inertial pos="0.5 0 0" mass="{number}" diaginertia="1 1 1"/></body></worldbody>
<actuator><motor joint="a" gear="2"/></actuator>
<keyframe><key name="home" qpos="0.1"/></keyframe></mujoco>"""
URDF = """<robot name="{name}"><link name="base"/><link name="rod"><inertial><origin xyz="0.5 0 0"/>
<mass value="{number}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="a" type="continuous"><parent link="base"/>
<child link="rod"/><axis xyz="0 {number} 0"/></joint></robot>"""
SDF = """<sdf version="1.9"><model name="{name}"><link name="rod"><pose>0.5 0 0 0 0 0</pose><inertial>
<mass>{number}</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>
<joint name="a" type="revolute"><parent>world</parent><child>rod</child><axis><xyz>0 1 0</xyz></axis></joint>
</model></sdf>"""
TABLE = "time,crank.position.x,crank.position.y\n0,0,0.25\n0.0005,0.0{number},0.25\n0.001,{number},0.24\n"
MOTION = '{{"scene": {{"name": "{name}"}}, "record": {number}}}'
SAMPLES = {".xml": MJCF, ".urdf": URDF, ".sdf": SDF, ".csv": TABLE, ".json": MOTION}
NUMBERS = ("1", "1", "1", "0", "-1", "1e300", "1e308", "inf", "nan", "", "x", "1 2", "9" * 5000)
NUMBERS += ("0" * 200_000,)
NAMES = ("model", "model", "../../up", "two words", "a\x1b[31mb", "&lt;b&gt;", "$x$", "$(touch pwned)", "")
PIECES = (
    *(b"", b"\x00", b"\xff\xfe", b"<", b">", b"<!--", b"]]>", b'"', b"&x;", b"<a>" * 3000, b"[" * 100_000),
    *(b"nan", b"1e400", b"null", b"{}", b"\n", b",", b";", b"\t", b"\x1b[2J", b"0\n" * 50, b"<include/>"),
)
RECORD: dict[str, Any] = {
    **{"key": "k1", "scene": "four_bar", "engine": "mbref", "version": "1", "method": "taylor"},
    **{"family": "taylor", "settings": {"rtol": 1e-9}, "outcome": "COMPLETED", "message": "", "t_end": 0.1},
    **{"times": [0.0, 0.1], "bodies": {}, "reactions": {}, "time_limit": 60.0, "seed": 0},
    "metrics": {"error": 1e-12, "error_bound": 1e-13, "error_until": 0.1},
    "cost": {"seconds": 0.01, "build_seconds": 0.1, "steps": 3},
    "asked": {"engine": "mbref", "options": {"rtol": 1e-9}, "end": 0.1, "samples": 2},
    **{"versions": {"python": "3"}, "machine": {"cpu": "x", "cores": 2, "system": "y"}},
}
STRANGE = (None, 0, -1, "x", "", [], {}, [None], {"a": 1}, True, 1e308, "\x1b[31m", [[1]], "<b>")
LINES = (b"null", b"[" * 100_000, b"\xff\x00", b"{}", b"[]", b'{"key": 1}', b'{"key": "a"}', b'"key"', b"NaN")


def write_file(draw: random.Random, suffixes: Sequence[str] = ()) -> str:
    """Write a file of one of the suffixes, damaged in two of three cases; return its name."""
    suffix = draw.choice(tuple(suffixes) or tuple(SAMPLES))
    text = SAMPLES[suffix].format(name=draw.choice(NAMES), number=draw.choice(NUMBERS))
    content = text.encode()
    for _ in range(draw.choice((0, 1, 1, 2))):
        a, b = sorted(draw.randrange(len(content) + 1) for _ in range(2))
        content = content[:a] + draw.choice(PIECES) + content[min(b, a + 30) :]
    path = Path(f"given{draw.choice(('', '', ' two', '$(id)'))}{suffix}")
    path.write_bytes(content)
    return str(path)


def write_folder(draw: random.Random) -> str:
    """Write a report's folder with a record that lacks a field, has a strange one, or is no record."""
    folder = Path(draw.choice(("records", "two records")))
    (folder / "scenes").mkdir(parents=True, exist_ok=True)
    if draw.random() < 0.7:
        from mbref.scenes import SCENES

        SCENES["four_bar"]().save(folder / "scenes" / "four_bar.toml")
    for name in draw.sample(("records", "timings", "truths", "motions", "stability", "paper"), 3):
        (folder / f"{name}.jsonl").write_bytes(_lines(draw))
    if draw.random() < 0.2:
        (folder / "conformance").mkdir(exist_ok=True)
        (folder / "conformance" / "mbref.json").write_bytes(_lines(draw))
    if draw.random() < 0.2:
        (folder / "paper-runs.json").write_bytes(_lines(draw))
    return draw.choice((str(folder), str(folder), f"{folder}/records.jsonl"))


def _lines(draw: random.Random) -> bytes:
    record = json.loads(json.dumps(RECORD))
    for _ in range(draw.choice((0, 1, 1, 2))):
        table = draw.choice([record, *(value for value in record.values() if isinstance(value, dict))])
        if table:
            key = draw.choice(sorted(table))
            if draw.random() < 0.4:
                del table[key]
            else:
                table[key] = draw.choice(STRANGE)
    lines = [json.dumps(record).encode()]
    if draw.random() < 0.4:
        lines.append(draw.choice(LINES))
    if draw.random() < 0.2:
        lines = [draw.choice(LINES)]
    return b"\n".join(lines) + b"\n" * (draw.random() < 0.9)
