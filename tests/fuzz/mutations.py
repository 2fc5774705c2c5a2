"""Mutations of scenes, methods and limits; each is drawn from a seeded generator."""

import copy
import random
from datetime import date
from typing import Any

import tomli_w

from mbref.scenes import SCENES
from tests.helpers.parts import joint
from tests.helpers.statics import rod

AXIS = [0.0, 1.0, 1.0]
PAIR = {"bodies": ["leaf", "bolt"]}
FULL = [[1.0, 0.1, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.2]]  # kg m²
STILL = {"velocity": [0.0, 0.0, 0.0], "angular_velocity": [0.0, 0.0, 0.0]}

# a scene with six types of joints, a driver and four types of loads
EVERYTHING = {
    "name": "everything",
    "gravity": [0.0, 0.0, -9.81],
    "duration": 0.1,
    "body": [
        rod("leaf", (0.5, 0.0, 0.0), 2.0, 1.0),
        {**rod("bolt", (1.0, 0.0, 0.0), 1.0), "inertia": FULL, **STILL},
        rod("ball", (1.0, 1.0, 0.0), 1.0, 1.0),
        rod("slide", (0.0, 1.0, 0.0), 1.0, 1.0),
        {**rod("tube", (0.0, 2.0, 0.0), 1.0, 1.0), "orientation": [0.6, 0.8, 0.0, 0.0]},
    ],
    "joint": [
        joint("r", "revolute", "ground", "leaf", axis=AXIS),
        joint("u", "universal", "leaf", "bolt", (1.0, 0.0, 0.0), axes=[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        joint("s", "spherical", "bolt", "ball", (1.0, 0.5, 0.0)),
        joint("t", "translational", "ground", "slide", axis=AXIS),
        joint("c", "cylindrical", "slide", "tube", axis=AXIS),
        joint("d", "distance", "ball", "slide", anchors=[[1.0, 1.0, 0.0], [0.0, 1.0, 0.5]]),
    ],
    "driver": [
        {"joint": "r", "polynomial": [0.0, 0.5], "sine": {"amplitude": 0.1, "frequency": 2.0, "phase": 0.0}}
    ],
    "load": [
        {"type": "moment", "body": "leaf", "moment": [0.0, 0.0, 1.0]},
        {"type": "force", "body": "ball", "point": [1.0, 1.0, 0.2], "force": [0.0, 1.0, 0.0]},
        {
            "type": "spring",
            **PAIR,
            "points": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
            "stiffness": 5.0,
            "natural_length": 0.5,
        },
        {"type": "torsion_spring", "joint": "c", "stiffness": 2.0, "damping": 0.1, "natural_angle": 1.0},
    ],
}

NUMBERS = (
    *(0, 1, -1, 2**63, -(2**63) - 1, 10**400, 0.0, -0.0, 1e-5, 1e5, -1e5, 1e-12, 1e12, 1e-100, 1e100, -1e100),
    *(1e-200, 1e200, -1e200, 5e-324, 2.2e-308, 1.7e308, -1.7e308, float("inf"), float("-inf"), float("nan")),
)
WORDS = (
    *("", " ", "ground", "the fixed frame", "leaf", "r", "fixed", "revolute", "spherical", "universal"),
    *("a\nb", "[red]x[/]", "[/nothing]", "$x_1$", "../../up", "a/b", "<b>&amp;</b>", "a|b", "x" * 5000, "ü"),
    *("\u202e", "\x00", "1.0", "nan", "body", "{0}", "%s"),
)


def strange(draw: random.Random) -> Any:
    """A value that a field hardly ever has, of any type that TOML knows."""
    deep: Any = 1.0
    for _ in range(draw.choice((3, 50, 3000))):
        deep = [deep]
    return draw.choice(
        [
            *(draw.choice(NUMBERS), draw.choice(NUMBERS), draw.choice(WORDS), True, False),
            *([], {}, [[]], deep, {"a": 1}, [{}], [1.0, 2.0], [draw.choice(NUMBERS)] * 3),
            *([[draw.choice(NUMBERS)] * 3] * 3, date(2020, 1, 1), [1.0, "x", 2.0]),
            [draw.uniform(-2, 2) for _ in range(3)],
        ]
    )


def base(draw: random.Random) -> dict[str, Any]:
    """The tables of a valid scene."""
    names = sorted(SCENES)
    k = draw.randrange(2 * len(names))
    return SCENES[names[k]]().to_dict() if k < len(names) else copy.deepcopy(EVERYTHING)


def places(data: Any, depth: int = 12) -> list[tuple[Any, Any]]:
    """Every (container, key) within tables and lists, down to a depth."""
    keys = list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    here = [(data, key) for key in keys]
    return here + [place for key in keys if depth for place in places(data[key], depth - 1)]


def mutated_data(draw: random.Random) -> dict[str, Any]:
    """A valid scene's tables with one to three changes."""
    data = base(draw)
    for _ in range(draw.randint(1, 3)):
        _change(draw, data)
    return data


def _change(draw: random.Random, data: dict[str, Any]) -> None:
    found = places(data)
    if draw.random() < 0.5:  # changes of numbers are refused less often, and so get further
        found = [(container, key) for container, key in found if isinstance(container[key], float)]
    if not found:
        return
    container, key = draw.choice(found)
    other, place = draw.choice(found)
    kind = draw.randrange(7)
    if isinstance(container[key], float) and kind < 4:
        container[key] *= draw.choice((-1.0, 0.0, 0.5, 1 + 1e-7, 1e3, 1e-3, 1e30, 1e-30, 1e160, 1e-160))
    elif kind == 0:
        del container[key]
    elif kind == 1 and isinstance(container, list):
        container.insert(key, _copied(container[key]))
    elif kind == 2 and isinstance(container, dict):
        container[draw.choice((*WORDS[:8], "mass", "axis", "type"))] = strange(draw)
    elif kind == 3:
        container[key] = _copied(other[place])
    else:
        container[key] = strange(draw)


def _copied(value: Any) -> Any:
    """A copy, unless it is nested too deeply for one."""
    try:
        return copy.deepcopy(value)
    except RecursionError:
        return 0


def mutated_text(draw: random.Random) -> bytes:
    """A scene file, changed as data, as text, or both."""
    data = mutated_data(draw) if draw.random() < 0.8 else base(draw)
    try:
        text = tomli_w.dumps(data).encode()
    except (TypeError, ValueError, RecursionError, AttributeError):  # nothing that TOML can write
        text = tomli_w.dumps(base(draw)).encode()
    return _smudged(draw, text) if draw.random() < 0.3 else text


def _smudged(draw: random.Random, text: bytes) -> bytes:
    """Bytes replaced, inserted, cut out or repeated."""
    for _ in range(draw.randint(1, 3)):
        a, b = sorted(draw.randrange(len(text) + 1) for _ in range(2))
        b = min(b, a + 40)
        piece = draw.choice(
            (
                *(b"", b"\xef\xbb\xbf", b"\xff\xfe", b"\x00", b"=", b"[", b"]" * 3, b"[["),
                *(b'"', b"\r\n", b"#"),
                *(b"1e9999", b"1" * 5000, b"0x" + b"f" * 400, b"[" * 4000, b"{a=" * 2000, text[a:b]),
                *(bytes([draw.randrange(256)]), b"\nname = 1\n", b"\n[[body]]\n", b"\n[body]\n"),
                *(b"1979-05-27", b"'''", b"\\u0000", b"\\ud800"),
            )
        )
        text = text[:a] + piece + text[b if draw.random() < 0.5 else a :]
    return text if text else b" "


METHODS = (
    *("alf-dual+projection", "alf-dual+projection", "alf+projection/adams", "lm1+baumgarte", "lm1+none/rk4"),
    *("mpi-svd+partitioning", "taylor"),
)
OPTIONS = ("alpha", "beta", "step", "max_order", "omega", "mu", "kept", "iterations", "", "nothing")
LIMITS = (
    *("rtol", "atol", "rank_tolerance", "violation", "first_step", "smallest_step", "forced_step"),
    *("largest_step", "largest_turn", "most_steps", "code"),
)
CODES = ("auto", "generic", "generated")
RATHER = (1e-3, 1e-6, 1e-9, 1e-12, 0.01, 0.1, 0.5, 1, 100)  # numbers that a user may well give


def number(draw: random.Random) -> float | int:
    """One of a user's numbers, or a strange one."""
    return draw.choice(RATHER if draw.random() < 0.6 else NUMBERS)


def method(draw: random.Random) -> str:
    """A method's name; one of three has an option, a strange piece or both."""
    name = draw.choice(METHODS)
    if draw.random() < 0.3:
        part = draw.choice(("baumgarte", "rk4", "adams", "alf", "dop853", "partitioning"))
        option = f"{draw.choice(OPTIONS)}={number(draw)}"
        name = name.replace(part, f"{part}[{option}]")
    if draw.random() < 0.1:
        k = draw.randrange(len(name) + 1)
        name = name[:k] + draw.choice(("+", "/", "[", "]", ",", "=", " ", "\n", "x", "", "é")) + name[k + 1 :]
    return name


def limits(draw: random.Random) -> dict[str, Any]:
    """Some fields of Limits; few steps unless drawn otherwise."""
    chosen: dict[str, Any] = {"most_steps": 500}
    for name in draw.sample(LIMITS, draw.choice((0, 0, 1, 1, 2, 3))):
        chosen[name] = draw.choice(CODES) if name == "code" else draw.choice(RATHER)
        if draw.random() < 0.1:
            chosen[name] = draw.choice((number(draw), strange(draw)))
    return chosen


def times(draw: random.Random) -> list[Any]:
    """Sample times, mostly increasing."""
    if draw.random() < 0.8:
        return [0.0, *sorted(draw.uniform(0, 0.1) for _ in range(draw.randint(1, 4)))]
    return [number(draw) for _ in range(draw.randint(0, 3))]
