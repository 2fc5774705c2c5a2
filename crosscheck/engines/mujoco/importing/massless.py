"""Massless links of a scene between the joints in a row of one body of the file.

A row of joints is one joint of the scene where a type with these motions exists. Springs, motors, armatures
and couplings act along single joints of the row, so that a row with them has links between its joints.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

from crosscheck.engines.mujoco.importing import chains
from crosscheck.engines.mujoco.importing.actuators import Law
from crosscheck.engines.mujoco.importing.chains import Chain, joints_of
from crosscheck.engines.mujoco.importing.closures import Closure
from crosscheck.engines.mujoco.importing.groups import Groups
from crosscheck.engines.mujoco.importing.posing import JointRow
from mbref.scene import Joint, SceneError

ARMATURE, LOAD, COUPLING, LOCK = "armature", "load", "coupling", "lock"
OF_CYLINDRICAL = {"hinge": {ARMATURE, LOAD, COUPLING}, "slide": {LOAD, COUPLING}}
Needs = Mapping[int, set[str]]  # MuJoCo's joint → what acts along its coordinate


def needs(model: Any, rows: Sequence[JointRow], laws: Sequence[Law]) -> Needs:
    """Return what acts along each hinge and slide: armatures, loads, couplings, locks."""
    found: dict[int, set[str]] = defaultdict(set)
    for j in range(model.njnt):
        v = int(model.jnt_dofadr[j])
        if model.dof_armature[v]:
            found[j].add(ARMATURE)
        if model.jnt_stiffness[j] or model.dof_damping[v]:
            found[j].add(LOAD)
    for law in laws:
        found[law.joint].add(LOAD)
    for row in rows:
        for j in row.joints:
            found[j].add(COUPLING if len(row.joints) > 1 else LOCK)
    return found


def held(model: Any, groups: Groups, closures: Sequence[Closure]) -> set[int]:
    """Return the groups at the ends of closures and of springs between sites."""
    sprung = [k for k in range(model.ntendon) if model.tendon_stiffness[k] or model.tendon_damping[k]]
    wraps = [w for k in sprung for w in range(model.tendon_adr[k], model.tendon_adr[k] + model.tendon_num[k])]
    bodies = [int(model.site_bodyid[model.wrap_objid[w]]) for w in wraps if _is_site(model, w)]
    bodies += [frame.body for closure in closures for frame in closure.frames]
    return {int(groups.of[b]) for b in bodies}


def _is_site(model: Any, wrap: int) -> bool:
    import mujoco

    return bool(model.wrap_type[wrap] == mujoco.mjtWrap.mjWRAP_SITE)


def read(
    mujoco: Any, groups: Groups, data: Any, wanted: Needs, extent: float
) -> list[tuple[Chain, list[Joint]]]:
    """Return the chains of the scene with their joints, and make their links pieces of the groups.

    Raises SceneError for joints in a row whose motion nothing determines.
    """
    found: list[tuple[Chain, list[Joint]]] = []
    for chain in chains.chains(mujoco, groups, data):
        joints = joints_of(chain, groups, extent)
        if joints is not None and _carries(chain, joints, wanted):
            found.append((chain, joints))
            continue
        _check(chain, groups, wanted, extent)
        found += [(part, cast(list[Joint], joints_of(part, groups, extent))) for part in chain.parts(groups)]
    ends = [chain.ends[1] for chain, _ in found]
    groups.keep({e.group for e in ends}, {e.last for e in ends})
    return found


def _carries(chain: Chain, joints: Sequence[Joint], wanted: Needs) -> bool:
    """Return whether joints of a scene have the coordinates along which something acts."""
    if len(chain.joints) == 1:
        return True
    carried = OF_CYLINDRICAL if [joint.type for joint in joints] == ["cylindrical"] else {}
    both = zip(chain.joints, chain.kinds, strict=True)
    return all(wanted.get(j, set()) <= carried.get(kind, set()) for j, kind in both)


def _check(chain: Chain, groups: Groups, wanted: Needs, extent: float) -> None:
    """Raise SceneError if joints without armature have dependent motions: no inertia resists a difference."""
    light = [k for k, j in enumerate(chain.joints) if ARMATURE not in wanted.get(j, set())]
    rest = Chain(
        chain.ends,
        tuple(chain.joints[k] for k in light),
        tuple(chain.kinds[k] for k in light),
        chain.anchors[light],
        chain.axes[light],
    )
    if light and chains.rank(rest, extent) < chains.freedoms(rest):
        raise SceneError(
            [
                f"body {groups.name(chain.ends[1])!r}: joints {', '.join(rest.kinds)} in a row have "
                "dependent motions and no mass between them, so that nothing determines their motion"
            ]
        )


def idle(groups: Groups, ends: set[int]) -> Iterator[str]:
    """Return a note for each group whose motion has no effect; ``ends`` are the groups that are held."""
    for g in chains.without_effect(groups, ends):
        yield f"body {groups.names[g]!r} has no mass and carries none: its motion has no effect"
