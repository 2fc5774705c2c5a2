"""One simulation by Pinocchio: the state, its right-hand side by ``constraintDynamics``, the integration."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from crosscheck.engine import Setting
from crosscheck.engines.pinocchio import compiled_run
from crosscheck.engines.pinocchio.families import (
    ANCHORED,
    BAUMGARTE,
    CHOSEN,
    CONVERGED,
    FIXED,
    IMPULSES_PGS,
    LCABA,
    STEPPED,
    TUNED_COMPILED,
    TYPICAL_MU,
)
from crosscheck.engines.pinocchio.model import Loads, Mechanism
from crosscheck.engines.pinocchio.new_models import Impulses, NewModels
from crosscheck.engines.shared.driver_motion import motion, stated_rate
from crosscheck.engines.shared.least_change import least_change, root_of_mass
from crosscheck.engines.shared.sampling import Adaptive, Counts, Failed, Sample, rk4, step_count
from crosscheck.engines.shared.tree_reactions import LinkMotion, sample_of
from crosscheck.judge.constraints import scene_length
from crosscheck.setting import unknown_family
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

# (state, its time, a later time) → state at the later time
Step = Callable[[np.ndarray, float, float], np.ndarray]
WITHOUT_PYTHON = 1e-9, 1e-7, 5  # solver parameters in compiled code, where fewer iterations suffice
FORCES = (
    1e-9,
    1e-6,
    50,
)  # solver parameters for forces of redundant closures, whose rounding errors grow as 1/mu
PROJECTIONS = 10  # largest number of Newton iterations; two are usual
CLOSED = 1e-13  # m and rad; residual at which a projection ends
NOTHING = 1e-12  # smaller entries of closure rows, relative to the scene's length, are rounding
CLOSED_ENOUGH = 1e-8  # m and rad; largest residual of a result
# rad; a driver moves by at most this in one adaptive step, since closures may change branch within larger
# ones
TURN_PER_STEP = 0.25
HINTS = {"defaults": ": the default solver settings fail on redundant closures"}


class Simulation:
    """One simulation: the state, its right-hand side and the method by which it is advanced."""

    def __init__(self, scene: Scene, setting: Setting):
        self.mechanism = mechanism = Mechanism(scene)
        self.pin, self.model = mechanism.pin, mechanism.model
        self.counts = Counts()
        self.loads = Loads(mechanism)
        self.nq = self.model.nq
        # entries of the Jacobian below this size are rounding
        self.least = NOTHING * max(1.0, scene_length(scene))
        self.flat = self.nq == self.model.nv  # True without quaternions: then dq/dt = v
        self.driven = [(mechanism.q_of_v[i], self.nq + i, driver) for i, driver in mechanism.driven]
        self.free = np.setdiff1d(np.arange(self.model.nv), [i for i, _ in mechanism.driven])
        self.frames = [mechanism.frame(k) for k in range(len(mechanism.tree.links))]
        self.still = self.loads.fixed and not self.loads.joint_springs and not self.driven
        self.y = np.concatenate([mechanism.q0, mechanism.v0])
        self.new: NewModels | None = None
        self._configure(setting)

    def _configure(self, setting: Setting) -> None:
        pin, family = self.pin, setting.family
        for closure in self.mechanism.closures if family == "baumgarte" else ():
            root = BAUMGARTE / setting.options["step"]
            closure.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(root**2, 2 * root))
        closures, options = self.mechanism.closures, setting.options
        self.is_looped = len(closures) > 0 and LCABA in (family, options.get("solver"))
        if self.is_looped:
            closures = [ground_second(pin, self.model, closure) for closure in closures]
        self.data = self.model.createData()
        if not self.model.check(self.data):
            raise AssertionError("Pinocchio's joints are not in depth-first order")
        self.hold(closures)
        self.hint = HINTS.get(family, "")
        given = ((), ()) if family == "defaults" else (CONVERGED, FORCES)
        self.solver, self.sampler = (pin.ProximalSettings(*options) for options in given)
        if self.is_looped:
            self.solver = self.sampler = pin.ProximalSettings(CONVERGED[0], TYPICAL_MU, CONVERGED[2])
            pin.computeJointMinimalOrdering(self.model, self.data, self.closures)
        if family in ANCHORED:
            beta = BAUMGARTE / options["step"]
            self.new = NewModels(pin, self.model, self.closures, family.upper(), beta)
        if family == CHOSEN:
            solver = pin.ProximalSettings(CONVERGED[0], options["mu"], options["iterations"])
            self.solver = self.sampler = solver
            if options["solver"] not in ("constraintDynamics", LCABA):
                self.new = NewModels(pin, self.model, self.closures, options["solver"])
        if family in STEPPED:
            feedback = Impulses(*(options.get(name, d) for name, d in Impulses._field_defaults.items()))
            solver = "PGS" if family == IMPULSES_PGS else "ADMM"
            self.new = NewModels(pin, self.model, self.closures, solver, 0.0, feedback)
            self.new.step = options["step"]
            self.step: Step = partial(self._by_impulses, options["step"])
        elif family in (*FIXED, CHOSEN):
            self.step = partial(self._rk4, setting.options["step"])
        elif family in ("dop853", "tuned"):
            settle = self.projected if family == "tuned" else None
            limits = (setting.options["min_step"], self._max_step())
            adaptive = Adaptive(self.rhs, settle, setting.options["rtol"], *limits, self.counts)
            self.step = adaptive.advance
        else:
            raise unknown_family("pinocchio", family)

    def hold(self, closures: Sequence[Any]) -> None:
        """Replace the constraints that hold by the given constraint models."""
        pin = self.pin
        self.closures = pin.StdVec_RigidConstraintModel()
        self.closures.extend(closures)
        self.closure_data = pin.StdVec_RigidConstraintData()
        self.closure_data.extend([c.createData() for c in self.closures])
        pin.initConstraintDynamics(self.model, self.data, self.closures, self.closure_data)

    def _max_step(self) -> float:
        if not self.driven:
            return np.inf
        return TURN_PER_STEP / stated_rate(self.mechanism.scene)

    def _rk4(self, step: float, y: np.ndarray, t0: float, t1: float) -> np.ndarray:
        return rk4(self.rhs, self.on_spheres, y, t0, t1, step, self.counts)

    def _by_impulses(self, step: float, y: np.ndarray, t0: float, t1: float) -> np.ndarray:
        """Return the state at t1 by steps of equal lengths, of whose accelerations the impulses are part."""
        assert self.new is not None
        count = step_count(t0, t1, step)
        h = self.new.step = (t1 - t0) / count
        for i in range(count):
            t = t0 + i * h
            q, v = self.split(t, y)
            v = v + h * self._finite(t, self.accelerations(t, q, v, self.solver))
            y = self.on_spheres(t + h, np.concatenate((self.pin.integrate(self.model, q, h * v), v)))
            self.counts.steps += 1
            self.counts.rhs += 1
        return y

    def advance(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1; raises Failed."""
        self._finite(t0, self.rhs(t0, self.y))
        self.y = self.step(self.y, t0, t1)

    def _finite(self, t: float, rates: np.ndarray) -> np.ndarray:
        if not np.isfinite(rates).all():
            raise Failed(Outcome.NOT_FINITE, t, f"the accelerations are not finite at {t:.6g} s{self.hint}")
        return rates

    def without_python(
        self, times: np.ndarray, setting: Setting, start: float, labels: dict[str, Any]
    ) -> Trajectory:
        """Return the run of a compiled family; the construction of the run began at ``start`` (s of process
        time)."""
        solver = compiled_run.Solver(*WITHOUT_PYTHON, setting.options.get("beta", 0.0), self.least)
        run = compiled_run.CompiledRun(self.mechanism, self.loads, solver)
        built, is_projected = time.process_time() - start, setting.family == TUNED_COMPILED

        def load(_: float, y: np.ndarray) -> None:
            self.y = y

        given = setting.options, is_projected, self._max_step()
        return run.trajectory(times, *given, load, self.sample, built, labels)

    def split(self, t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return configuration and velocity of a state vector, with driven coordinates as prescribed at t."""
        if self.driven:
            y = y.copy()
            for iq, iv, driver in self.driven:
                y[iq], y[iv], _ = motion(driver, t)
        q, v = y[: self.nq], y[self.nq :]
        return (q if self.flat else self.pin.normalize(self.model, q)), v

    def rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the time derivative (nq + nv,) of the state."""
        q, v = self.split(t, y)
        a = self.accelerations(t, q, v, self.solver)
        rates = v if self.flat else self.pin.tangentMap(self.model, q) @ v
        return np.concatenate((rates, a))

    def accelerations(self, t: float, q: np.ndarray, v: np.ndarray, solver: Any) -> np.ndarray:
        """Return joint accelerations (nv,) from Pinocchio."""
        tau = self.loads.constant if self.still else self.loads.torques(t, q, v)
        if self.new:
            return self.new.accelerations(t, q, v, tau)
        solve = self.pin.lcaba if self.is_looped else self.pin.constraintDynamics
        return solve(self.model, self.data, q, v, tau, self.closures, self.closure_data, solver)

    def on_spheres(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the state with unit quaternions and driven coordinates as prescribed."""
        return y if self.flat and not self.driven else np.concatenate(self.split(t, y))

    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the nearest state, measured by kinetic energy, whose positions and velocities satisfy the
        closures. With kinetic energy as metric, rounding errors of a light body do not move a heavy body."""
        q, v = self.split(t, y)
        if not len(self.closures):
            return np.concatenate((q, v))
        root = root_of_mass(self.pin.crba(self.model, self.data, q)[np.ix_(self.free, self.free)], t)
        for _ in range(PROJECTIONS):
            residual, jacobian = self.closure_errors(q)
            if not abs(residual).max() > CLOSED:
                break
            q = self.pin.integrate(self.model, q, self._least_change(t, root, jacobian, residual))
        if not abs(residual).max() < CLOSED_ENOUGH:
            raise Failed(Outcome.NOT_CONVERGED, t, f"the closures could not be met at {t:.6g} s")
        v = v - self._least_change(t, root, jacobian, jacobian @ v)
        return np.concatenate((q, v))

    def closure_errors(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return closure residuals (rows,), m and rad, and the Jacobian (rows, nv): d residual = -J dq."""
        pin = self.pin
        pin.computeJointJacobians(self.model, self.data, q)
        residual = []
        for closure, data in zip(self.closures, self.closure_data, strict=True):
            closure.calc(self.model, self.data, data)
            point = closure.type == pin.ContactType.CONTACT_3D
            residual.append(data.c1Mc2.translation if point else pin.log6(data.c1Mc2).vector)
        jacobian = pin.getConstraintsJacobian(self.model, self.data, self.closures, self.closure_data)
        jacobian = jacobian.reshape(-1, self.model.nv)  # Pinocchio gives a vector for one coordinate
        moves = np.abs(jacobian).max(axis=1, keepdims=True) > self.least
        return np.concatenate(residual), np.where(moves, jacobian, 0.0)

    def _least_change(
        self, t: float, root: np.ndarray, jacobian: np.ndarray, target: np.ndarray
    ) -> np.ndarray:
        """Return the dv (nv,) of least kinetic energy, zero in driven coordinates, with J dv = target."""
        change = np.zeros(self.model.nv)
        change[self.free] = least_change(root, jacobian[:, self.free], target, t)
        return change

    def sample(self, t: float) -> Sample:
        """Return poses, velocities and reactions of the scene's bodies and joints."""
        q, v = self.split(t, self.y)
        motion = self.link_motion(t, q, v)
        scene, tree = self.mechanism.scene, self.mechanism.tree
        closing = self.closing() if scene.has_mass() and not self.is_looped else None
        return sample_of(scene, tree, motion, closing)

    def link_motion(self, t: float, q: np.ndarray, v: np.ndarray) -> LinkMotion:
        """Return the motion of the links; the closure forces of this state are then in the closures' data."""
        pin, model, data = self.pin, self.model, self.data
        a = self._finite(t, self.accelerations(t, q, v, self.sampler))
        pin.forwardKinematics(model, data, q, v, a)
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        frames = [(j, pin.SE3(np.eye(3), c)) for j, c in self.frames]
        poses = [data.oMi[j] * place for j, place in frames]
        twists = [pin.getFrameVelocity(model, data, j, place, frame) for j, place in frames]
        changes = [pin.getFrameClassicalAcceleration(model, data, j, place, frame) for j, place in frames]
        return LinkMotion(
            rotation=np.array([pose.rotation for pose in poses]),
            position=np.array([pose.translation for pose in poses]),
            velocity=np.array([twist.linear for twist in twists]),
            angular_velocity=np.array([twist.angular for twist in twists]),
            acceleration=np.array([change.linear for change in changes]),
            angular_acceleration=np.array([change.angular for change in changes]),
            coordinates=self.mechanism.coordinates(q),
            rates=v,
        )

    def closing(self) -> list[np.ndarray]:
        """Return the wrench on the second link of each closure of the tree."""
        wrenches = [np.zeros(6) for _ in self.mechanism.tree.closures]
        forces = [data.contact_force for data in self.closure_data]
        if self.new:
            forces = [self.pin.Force(np.resize(f, 6) * (np.arange(6) < len(f))) for f in self.new.forces]
        for k, closure, force in zip(self.mechanism.closed, self.closures, forces, strict=True):
            place = self.data.oMi[closure.joint1_id] * closure.joint1_placement
            wrenches[k] = -place.act(force).vector
        return wrenches


def ground_second(pin: Any, model: Any, closure: Any) -> Any:
    """Return a closure as lcaba of Pinocchio 4.1.0 takes it: its first joint is not the ground."""
    if closure.joint1_id:
        return closure
    ends = (closure.joint2_id, closure.joint2_placement, closure.joint1_id, closure.joint1_placement)
    return pin.RigidConstraintModel(closure.type, model, *ends, pin.ReferenceFrame.LOCAL)
