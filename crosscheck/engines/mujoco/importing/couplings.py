"""Equalities of joints and tendons as rows of joint coordinates, and couplings that no scene can describe."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.left_out import Part, joint_name
from crosscheck.engines.mujoco.importing.posing import JointRow

ROUNDED = 1e-12  # coefficient of a tendon / largest one; smaller ones are rounding


def of_equalities(mujoco: Any, model: Any) -> Iterator[JointRow | Part | str]:
    """Return a row for each active equality that locks or couples hinges and slides.

    Other active equalities, except connects and welds, are parts to be left out, and are made inactive in the
    model. An inactive equality yields a note.
    """
    kinds = mujoco.mjtEq
    for e in range(model.neq):
        name, kind = model.equality(e).name or f"equality {e}", kinds(model.eq_type[e])
        if not model.eq_active0[e]:
            yield f"equality {name!r} is not active: it is not part of the scene"
        elif kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            found = _row(mujoco, model, e, name)
            if isinstance(found, Part):
                model.eq_active0[e] = 0
            yield found


def removed(mujoco: Any, model: Any, row: JointRow) -> Part:
    """Return the part for a row of coordinates that no scene has, and make its equality inactive."""
    names = " and ".join(joint_name(model, j) for j in row.joints)
    e = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_EQUALITY, row.name))
    e = int(row.name.rpartition(" ")[2]) if e < 0 and row.name.startswith("equality ") else e
    if e >= 0:  # a row of a URDF is no equality of the model
        model.eq_active0[e] = 0
    return Part(
        "couplings", f"equality {row.name!r} of {names}, which is no single hinge or slide of the scene"
    )


def _word(kind: Any) -> str:
    return str(kind.name.removeprefix("mjEQ_").lower())


def _row(mujoco: Any, model: Any, e: int, name: str) -> JointRow | Part:
    kinds, kind = mujoco.mjtEq, mujoco.mjtEq(model.eq_type[e])
    label = f"equality {name!r} of type {_word(kind)}"
    if kind not in (kinds.mjEQ_JOINT, kinds.mjEQ_TENDON):
        return Part("couplings", label)
    second = int(model.eq_obj2id[e])
    offset, ratio = (float(number) for number in model.eq_data[e, :2])
    higher = tuple(-float(number) for number in np.trim_zeros(model.eq_data[e, 2:5], "b"))
    if second >= 0 and higher and kind != kinds.mjEQ_JOINT:
        return Part("couplings", f"{label}, whose polynomial is not linear")
    first = int(model.eq_obj1id[e])
    if kind == kinds.mjEQ_JOINT:
        if second < 0 or not (ratio or higher):
            return JointRow(name, (first,), offset, (1.0,))
        return JointRow(name, (first, second), offset, (1.0, -ratio), higher)
    return _tendon_row(mujoco, model, name, label, [(first, 1.0), (second, -ratio)], offset)


def _tendon_row(
    mujoco: Any, model: Any, name: str, label: str, tendons: list[tuple[int, float]], offset: float
) -> JointRow | Part:
    """Return the row of lengths of fixed tendons: the sum of factor · length is the offset."""
    sums: dict[int, float] = defaultdict(float)
    for tendon, factor in tendons:
        for w in range(*_wraps(model, tendon)) if tendon >= 0 else ():
            if model.wrap_type[w] != mujoco.mjtWrap.mjWRAP_JOINT:
                return Part("couplings", f"{label}, of a tendon that no fixed sum of joint coordinates gives")
            sums[int(model.wrap_objid[w])] += factor * float(model.wrap_prm[w])
    largest = max(map(abs, sums.values()), default=0.0)
    ends = [j for j, number in sums.items() if abs(number) > ROUNDED * largest]
    if not ends:
        return Part("couplings", f"{label}, which couples no joints")
    one = sums[ends[0]]
    return JointRow(name, tuple(ends), offset / one, tuple(sums[j] / one for j in ends))


def _wraps(model: Any, tendon: int) -> tuple[int, int]:
    start = int(model.tendon_adr[tendon])
    return start, start + int(model.tendon_num[tendon])
