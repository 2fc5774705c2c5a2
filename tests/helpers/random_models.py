"""Random MJCF and URDF files: trees of idioms of joints, loops open at the reference, other parts."""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from mbref.formats import ImportOptions

REACH = 0.3  # rad and m, from the reference to the pose at which loops are closed


@dataclass
class File:
    """The text of a random file, and how it is read."""

    text: str
    suffix: str
    options: ImportOptions = field(default_factory=ImportOptions)
    loops: list[tuple[str, np.ndarray, str, np.ndarray]] = field(default_factory=list)  # spherical joints
    mimics: list[tuple[str, str, float]] = field(default_factory=list)  # joint, the one it follows, ratio


def numbers(values) -> str:
    return " ".join(repr(float(v)) for v in np.atleast_1d(values))


def unit(random) -> np.ndarray:
    v = random.normal(size=3)
    return v / np.linalg.norm(v)


def across(random, axis) -> np.ndarray:
    v = np.cross(axis, unit(random))
    return v / np.linalg.norm(v)


def inertia(random) -> tuple[float, np.ndarray]:
    """Mass and a physical inertia matrix (3, 3)."""
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    a, b, c = random.uniform(0.01, 0.03, 3)
    return float(random.uniform(0.5, 2.0)), turn @ np.diag([a + b, a + c, b + c]) @ turn.T


IDIOMS = ("hinge", "hinge", "slide", "ball", "universal", "cylindrical", "planar", "three hinges", "rod")
IDIOMS += ("free", "parallel", "skew", "fixed")


def motions(idiom: str, random) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """(type, position, axis) of the joints of an idiom; only "skew" has no joint of a scene."""
    zero, a = np.zeros(3), unit(random)
    b = across(random, a)
    c, p, q = np.cross(a, b), random.normal(size=3) * 0.1, random.normal(size=3) * 0.2
    return {
        "hinge": [("hinge", p, a)],
        "slide": [("slide", p, a)],
        "ball": [("ball", p, a)],
        "fixed": [],
        "universal": [("hinge", p + 0.1 * a, a), ("hinge", p, b)],
        "cylindrical": [("slide", zero, a), ("hinge", p, a)],
        "planar": [("slide", zero, b), ("slide", zero, b + 0.5 * c), ("hinge", p, a)],
        "three hinges": [("hinge", p, a), ("hinge", p, b), ("hinge", p, c + 0.3 * b)],
        "rod": [("hinge", p, a), ("hinge", p, b), ("ball", q + 0.3 * c, a)],
        "free": [("slide", zero, a), ("slide", zero, b), ("slide", zero, c), ("ball", p, a)],
        "parallel": [("hinge", p, a), ("hinge", p + 0.2 * b, a)],
        "skew": [("hinge", p, a), ("hinge", p, a + 0.5 * b)],
    }[idiom]


def mjcf_tree(random) -> tuple[str, list[str], list[str]]:
    """Text of a worldbody, names of its bodies, names of its hinges and slides."""
    bodies, hinges, elements = ["world"], [], {"world": []}
    texts: dict[str, list[str]] = {}
    for k in range(int(random.integers(2, 6))):
        parent = str(random.choice(bodies))
        idiom = str(random.choice(IDIOMS if k else IDIOMS[:-1]))
        mass, matrix = inertia(random)
        own = []
        for i, (kind, place, axis) in enumerate(motions(idiom, random)):
            name = f"j{k}_{i}"
            extra = _springs(random) if idiom == "hinge" else ""
            turning = "" if kind == "ball" else f'axis="{numbers(axis)}"'
            own.append(f'<joint name="{name}" type="{kind}" pos="{numbers(place)}" {turning} {extra}/>')
            hinges += [name] if idiom in ("hinge", "slide") else []
        full = numbers([matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[0, 1], matrix[0, 2], matrix[1, 2]])
        centre = numbers(random.normal(size=3) * 0.1)
        own.append(f'<inertial pos="{centre}" mass="{mass!r}" fullinertia="{full}"/>')
        name, quat, at = f"b{k}", random.normal(size=4), random.normal(size=3) * 0.4
        texts[name] = [f'<body name="{name}" pos="{numbers(at)}" quat="{numbers(quat)}">', *own]
        elements[parent].append(name)
        elements[name] = []
        bodies.append(name)

    def written(name: str) -> str:
        inner = "".join(written(child) for child in elements[name])
        return inner if name == "world" else "".join(texts[name]) + inner + "</body>"

    return written("world"), bodies, hinges


def _springs(random) -> str:
    own = ["", "", 'stiffness="2" springref="0.3" ref="0.1"', 'damping="0.4"', 'armature="0.1" ref="-0.2"']
    return str(random.choice(own))


def posed(text: str, random) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The tree near its reference."""
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{text}</mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_integratePos(model, data.qpos, random.uniform(-REACH, REACH, model.nv), 1.0)
    mujoco.mj_kinematics(model, data)
    return model, data


def local(data, body: int, point: np.ndarray) -> np.ndarray:
    return data.xmat[body].reshape(3, 3).T @ (point - data.xpos[body])


def mjcf(seed: int) -> File:
    """A random MJCF file: a tree, and connects, welds, locks, couplings, tendons, springs and rotors."""
    random = np.random.default_rng(seed)
    tree, bodies, hinges = mjcf_tree(random)
    inside = '<compiler angle="radian"/><option gravity="0.3 -1 -9.81"/>'
    model, data = posed(f"{inside}<worldbody>{tree}</worldbody>", random)
    sites: dict[str, str] = {name: "" for name in bodies}
    equalities = ""
    for k in range(int(random.integers(0, 3))):
        first, second = (str(b) for b in random.choice(bodies, 2, replace=False))
        a, b = (model.body(name).id for name in (first, second))
        point = data.xpos[b] + random.normal(size=3) * 0.2
        kind = str(random.choice(["site connect", "connect", "weld", "ball weld"]))
        if kind == "site connect":
            for end, body in ((0, a), (1, b)):
                name = (first, second)[end]
                sites[name] += f'<site name="s{k}_{end}" pos="{numbers(local(data, body, point))}"/>'
            equalities += f'<connect name="c{k}" site1="s{k}_0" site2="s{k}_1"/>'
        elif kind == "connect":
            anchor = numbers(local(data, a, point))
            equalities += f'<connect name="c{k}" body1="{first}" body2="{second}" anchor="{anchor}"/>'
        else:
            inverse, relative = np.zeros(4), np.zeros(4)
            mujoco.mju_negQuat(inverse, data.xquat[a])
            mujoco.mju_mulQuat(relative, inverse, data.xquat[b])
            pose = numbers(np.concatenate([local(data, a, data.xpos[b]), relative]))
            scale = ' torquescale="0"' if kind == "ball weld" else ""
            equalities += f'<weld name="c{k}" body1="{first}" body2="{second}" relpose="{pose}"{scale}/>'
    without: list[str] = []
    if len(hinges) > 1 and random.uniform() < 0.3:
        equalities += f'<joint name="gear" joint1="{hinges[0]}" joint2="{hinges[1]}" polycoef="0 2 0 0 0"/>'
    more = ""
    if len(hinges) > 2 and random.uniform() < 0.3:
        ends = "".join(f'<joint joint="{n}" coef="{float(random.uniform(0.5, 2))!r}"/>' for n in hinges[-2:])
        more += f'<tendon><fixed name="rope">{ends}</fixed></tendon>'
        offset = float(random.uniform(-0.2, 0.2))
        equalities += f'<tendon name="held" tendon1="rope" polycoef="{offset!r} 0 0 0 0"/>'
    if hinges and random.uniform() < 0.4:
        gear, rotor, brake = random.uniform(0.1, 2.0, 3).tolist()
        motor = f'joint="{hinges[-1]}" gear="{gear!r}" armature="{rotor!r}" damping="{brake!r}"'
        more += f"<actuator><motor {motor}/></actuator>"
    for name, text in sites.items():
        if name == "world":
            tree += text
        else:
            at = tree.index(">", tree.index(f'<body name="{name}"')) + 1
            tree = tree[:at] + text + tree[at:]
    text = f"<mujoco>{inside}<worldbody>{tree}</worldbody><equality>{equalities}</equality>{more}</mujoco>"
    return File(text, ".xml", ImportOptions(without=without))


def urdf(seed: int) -> File:
    """A random URDF file: links without mass in between and at the ends, fixed links, mimic, closed pairs."""
    random = np.random.default_rng(seed)
    links, text, count = ["base"], '<link name="base"/>', int(random.integers(3, 8))
    massive = ["base"]
    for k in range(count):
        name, parent = f"l{k}", str(random.choice(massive))
        kind = str(random.choice(["continuous", "revolute", "prismatic", "fixed", "middle", "middle"]))
        a = unit(random)
        if kind == "middle":  # a universal joint, or parallel hinges apart
            is_universal = random.uniform() < 0.5
            b, apart = (across(random, a), np.zeros(3)) if is_universal else (a, across(random, a) * 0.2)
            text += f'<link name="m{k}"/>' + _joint(f"i{k}", "continuous", parent, f"m{k}", a, random)
            text += _link(name, random) + _joint(f"j{k}", "continuous", f"m{k}", name, b, None, apart)
        else:
            text += _link(name, random) + _joint(f"j{k}", kind, parent, name, a, random, mimic=k > 1 and k)
        massive.append(name)
        links.append(name)
        text += f'<link name="f{k}"/>' + _joint(f"tip{k}", "fixed", name, f"f{k}", a, random)
    file = File(f'<robot name="random">{text}</robot>', ".urdf", ImportOptions(without=["couplings"]))
    file.mimics = [(f"j{k}", f"j{k - 1}", 2.0) for k in range(count) if f'<mimic joint="j{k - 1}" ' in text]
    return _with_loop(file, massive, random) if random.uniform() < 0.6 else file


def _link(name: str, random) -> str:
    mass, i = inertia(random)
    entries = " ".join(f'i{"xyz"[r]}{"xyz"[c]}="{float(i[r, c])!r}"' for r in range(3) for c in range(r, 3))
    return (
        f'<link name="{name}"><inertial><origin xyz="{numbers(random.normal(size=3) * 0.1)}"/>'
        f'<mass value="{mass!r}"/><inertia {entries}/></inertial></link>'
    )


def _joint(name, kind, parent, child, axis, random, place=None, mimic=0) -> str:
    place = random.normal(size=3) * 0.3 if place is None else place
    rpy = numbers(random.uniform(-1, 1, 3)) if random is not None else "0 0 0"
    is_limited = kind in ("revolute", "prismatic")
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>' if is_limited else ""
    follows = f'<mimic joint="j{mimic - 1}" multiplier="2"/>' if mimic and random.uniform() < 0.1 else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{numbers(place)}" rpy="{rpy}"/><axis xyz="{numbers(axis)}"/>{limit}{follows}</joint>'
    )


def _with_loop(file: File, massive: list[str], random) -> File:
    """Two frames without mass that meet near the reference, to be closed by ``--close``."""
    from crosscheck.engines.mujoco.importing.urdf import prepared

    model = mujoco.MjModel.from_xml_string(prepared(file.text).text)
    data = mujoco.MjData(model)
    mujoco.mj_integratePos(model, data.qpos, random.uniform(-REACH, REACH, model.nv), 1.0)
    mujoco.mj_kinematics(model, data)
    first, second = (str(name) for name in random.choice(massive[1:], 2, replace=False))
    point, ends, extra = data.xpos[model.body(second).id] + random.normal(size=3) * 0.2, [], ""
    for k, link in enumerate((first, second)):
        at = local(data, model.body(link).id, point)
        ends += [link, at]
        fixed = _joint(f"loop_joint_{k}", "fixed", link, f"loop_{k}", [1, 0, 0], None, at)
        extra += f'<link name="loop_{k}"/>{fixed}'
    text = file.text.replace("</robot>", f"{extra}</robot>")
    options = ImportOptions(without=file.options.without, close=["loop_0=loop_1"])
    return File(text, ".urdf", options, [tuple(ends)], file.mimics)
