"""Actuators with constant control as springs, dampers and constant forces along hinges and slides.

An actuator exerts gain · input + bias, both linear in its length and velocity, which are gear times the
joint's.  A motor is a constant force, a position servo a spring with a natural angle, a velocity servo a
damper and a constant force.  Armature and damping of actuators act without control too.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.left_out import Part


@dataclass(frozen=True)
class Law:
    """Force or torque constant - stiffness · q - damping · q' along MuJoCo's joint, q in its coordinate."""

    joint: int
    constant: float
    stiffness: float = 0.0
    damping: float = 0.0

    @property
    def is_constant(self) -> bool:
        """Whether the force depends on neither position nor velocity."""
        return not self.stiffness and not self.damping


class Actuators:
    """The actuators of a model at the control values of a keyframe; without keyframe all values are 0.

    Attributes
    ----------
    laws : list of Law
        One law for each actuator that acts and that a scene describes.
    parts : list of Part
        Actuators that act and that no scene describes. They exert no force in the model any more.
    idle : int
        Number of actuators that exert no force.
    """

    def __init__(self, mujoco: Any, model: Any, key: int):
        self.mujoco, self.model = mujoco, model
        self.control = np.zeros(model.nu) if key < 0 else model.key_ctrl[key].copy()
        self.activation = np.zeros(model.na) if key < 0 else model.key_act[key].copy()
        self.laws: list[Law] = []
        self.parts = list(moved_to_joints(mujoco, model))
        acting = [a for a in range(len(model.actuator_gear)) if self._acts(a)]
        self.idle = len(model.actuator_gear) - len(acting)
        found = [(a, self._law(a)) for a in acting]
        for a, law in self._within_joint_limits(found):
            if isinstance(law, Law):
                self.laws.append(law)
            else:
                self.parts.append(Part("motors", f"{self._name(a)}, {law}"))
                self._silence(a)

    def prepare(self, data: Any) -> None:
        """Set the controls and activations of MuJoCo's data."""
        data.ctrl[:], data.act[:] = self.control, self.activation

    def leave_out(self, joint: int, label: str) -> Part:
        """Return the part for the actuators of a joint whose coordinate no load of a scene has."""
        self.laws = [law for law in self.laws if law.joint != joint]
        for a in range(len(self.model.actuator_gear)):
            if (arm := self._arm(a)) is not None and arm[0] == joint:
                self._silence(a)
        return Part("motors", f"actuators of joint {label}")

    def _name(self, a: int) -> str:
        name = self.model.actuator(a).name
        return f"actuator {name!r}" if name else f"actuator {a}"

    def _acts(self, a: int) -> bool:
        """Return whether an actuator may exert a force."""
        model = self.model
        if model.opt.disableflags & self.mujoco.mjtDisableBit.mjDSBL_ACTUATION:
            return False
        group = int(model.actuator_group[a])
        if 0 <= group < 31 and int(model.opt.disableactuator) >> group & 1:
            return False
        inputs = [*self._clipped(a), *self.activation[self._activations(a)]]
        if (bias := int(model.actuator_biastype[a])) == int(self.mujoco.mjtBias.mjBIAS_AFFINE):
            return bool(np.any(model.actuator_biasprm[a, :3]) or np.any(inputs))
        return bias != int(self.mujoco.mjtBias.mjBIAS_NONE) or bool(np.any(inputs))

    def _controls(self, a: int) -> slice:
        first = int(self.model.actuator_ctrladr[a])
        return slice(first, first + int(self.model.actuator_ctrlnum[a]))

    def _clipped(self, a: int) -> np.ndarray:
        """Return the controls of an actuator within their range, which may exclude 0."""
        controls, model = self.control[self._controls(a)], self.model
        is_free = bool(model.opt.disableflags & self.mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
        if is_free or not model.actuator_ctrllimited[a]:
            return controls
        return np.clip(controls, *model.actuator_ctrlrange[a])

    def _activations(self, a: int) -> slice:
        first = int(self.model.actuator_actadr[a])
        return slice(first, first + int(self.model.actuator_actnum[a])) if first >= 0 else slice(0, 0)

    def _arm(self, a: int) -> tuple[int, float] | None:
        """Return the hinge or slide that an actuator moves, and length / coordinate; None for another
        transmission."""
        model, kinds = self.model, self.mujoco.mjtTrn
        first, gear = int(model.actuator_trnid[a, 0]), float(model.actuator_gear[a, 0])
        if int(model.actuator_trntype[a]) in (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)):
            return (first, gear) if self._is_single(first) else None
        if model.actuator_trntype[a] == kinds.mjTRN_TENDON and model.tendon_num[first] == 1:
            wrap = int(model.tendon_adr[first])
            if model.wrap_type[wrap] == self.mujoco.mjtWrap.mjWRAP_JOINT:
                return int(model.wrap_objid[wrap]), gear * float(model.wrap_prm[wrap])
        return None

    def _is_single(self, joint: int) -> bool:
        kinds = self.mujoco.mjtJoint
        return int(self.model.jnt_type[joint]) in (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE))

    def _law(self, a: int) -> Law | str:
        """Return the law of an actuator, or the reason why a scene has none."""
        model, mujoco = self.model, self.mujoco
        arm, given = self._arm(a), self._input(a)
        if arm is None:
            return "which acts on no single hinge or slide"
        gains = (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE))
        biases = (int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE))
        if int(model.actuator_gaintype[a]) not in gains or int(model.actuator_biastype[a]) not in biases:
            return "whose force is not linear in position and velocity"
        if given is None:
            return "whose input changes over time"
        gain, bias = model.actuator_gainprm[a, :3].copy(), model.actuator_biasprm[a, :3].copy()
        gain[1:] *= model.actuator_gaintype[a] == gains[1]
        constant, position, velocity = (
            gain * given + bias * (model.actuator_biastype[a] == biases[1])
        ).tolist()
        joint, ratio = arm
        law = Law(joint, ratio * constant, -(ratio**2) * position, -(ratio**2) * velocity)
        if law.stiffness < 0 or law.damping < 0:
            return "whose stiffness or damping is negative"
        return self._within_force_range(a, law, ratio)

    def _within_force_range(self, a: int, law: Law, ratio: float) -> Law | str:
        """Return the law of an actuator with a constant force within its limits."""
        model = self.model
        is_tendon = model.actuator_trntype[a] == self.mujoco.mjtTrn.mjTRN_TENDON
        if is_tendon and model.tendon_actfrclimited[int(model.actuator_trnid[a, 0])]:
            return "whose tendon has a range of forces"
        if not model.actuator_forcelimited[a] or not ratio:
            return law
        if not law.is_constant:
            return "whose range of forces no spring or damper of a scene has"
        return replace(
            law, constant=ratio * float(np.clip(law.constant / ratio, *model.actuator_forcerange[a]))
        )

    def _within_joint_limits(self, found: Sequence[tuple[int, Law | str]]) -> Iterator[tuple[int, Law | str]]:
        """Return the laws within ``actuatorfrcrange`` of their joints, which limits the sum of all forces."""
        by_joint: dict[int, list[Law]] = defaultdict(list)
        for _, law in found:
            if isinstance(law, Law):
                by_joint[law.joint].append(law)
        for a, law in found:
            if not isinstance(law, Law) or not self.model.jnt_actfrclimited[law.joint]:
                yield a, law
            elif not all(each.is_constant for each in by_joint[law.joint]):
                yield a, "whose joint has a range of forces (actuatorfrcrange)"
            else:
                total = sum(each.constant for each in by_joint[law.joint])
                clipped = float(np.clip(total, *self.model.jnt_actfrcrange[law.joint]))
                yield a, replace(law, constant=law.constant * (clipped / total if total else 0.0))

    def _input(self, a: int) -> float | None:
        """Return the constant input of an actuator, its control or its activation; None if it changes."""
        model, kinds = self.model, self.mujoco.mjtDyn
        controls, activations = self._clipped(a), self.activation[self._activations(a)]
        if len(controls) != 1 or len(activations) > 1 or (model.actuator_delay[a] and np.any(controls)):
            return None
        control = float(controls[0])
        if model.actuator_dyntype[a] == kinds.mjDYN_NONE:
            return control
        if not len(activations):
            return None
        steady = {int(kinds.mjDYN_INTEGRATOR): 0.0}
        steady |= dict.fromkeys(
            (int(kinds.mjDYN_FILTER), int(kinds.mjDYN_FILTEREXACT)), float(activations[0])
        )
        if steady.get(int(model.actuator_dyntype[a])) != control:
            return None
        low, high = model.actuator_actrange[a]
        is_inside = not model.actuator_actlimited[a] or low <= activations[0] <= high
        return float(activations[0]) if is_inside else None

    def _silence(self, a: int) -> None:
        """Let an actuator exert no force in the model."""
        model, mujoco = self.model, self.mujoco
        model.actuator_gaintype[a], model.actuator_biastype[a] = (
            int(mujoco.mjtGain.mjGAIN_FIXED),
            int(mujoco.mjtBias.mjBIAS_NONE),
        )
        model.actuator_gainprm[a], model.actuator_biasprm[a] = 0.0, 0.0


def moved_to_joints(mujoco: Any, model: Any) -> Iterator[Part]:
    """Add armature and damping of actuators, times gear², to their hinges and slides in the model.

    An actuator of another transmission, or with damping that is not linear, gives a part to be left out.
    """
    transmissions, joints = mujoco.mjtTrn, mujoco.mjtJoint
    of_joints = {int(transmissions.mjTRN_JOINT), int(transmissions.mjTRN_JOINTINPARENT)}
    single = {int(joints.mjJNT_HINGE), int(joints.mjJNT_SLIDE)}
    for a in range(len(model.actuator_armature)):
        j, gear = int(model.actuator_trnid[a, 0]), float(model.actuator_gear[a, 0])
        is_plain = int(model.actuator_trntype[a]) in of_joints and int(model.jnt_type[j]) in single
        name = model.actuator(a).name or f"actuator {a}"
        for kind, numbers, of_joint in (
            ("armature", model.actuator_armature, model.dof_armature),
            ("damping", model.actuator_damping, model.dof_damping),
        ):
            if is_plain:
                of_joint[model.jnt_dofadr[j]] += gear**2 * numbers[a]
            elif numbers[a]:
                yield Part(kind, f"{kind} of {name!r}, which is no actuator of a hinge or slide")
        if np.any(model.actuator_dampingpoly[a]):
            yield Part("damping", f"polynomial damping of {name!r}")
    for numbers in (model.actuator_armature, model.actuator_damping, model.actuator_dampingpoly):
        numbers[...] = 0
