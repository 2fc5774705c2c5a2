"""One simulation by MuJoCo: the model at a setting, its data, its steps and samples."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from crosscheck.engine import Setting
from crosscheck.engines.mujoco import compiled_run
from crosscheck.engines.mujoco.families import (
    ADAPTIVE,
    CHOSEN,
    COMPILED,
    CONVERGED,
    DEFAULT_STEP,
    HARD,
    INTEGRATED_HERE,
    MOST_ITERATIONS,
    RK4,
    SOLVING,
    STIFFEST,
    STOCK,
)
from crosscheck.engines.mujoco.model import compiled
from crosscheck.engines.mujoco.options import change as change_options
from crosscheck.engines.mujoco.projection import projected
from crosscheck.engines.mujoco.warnings_off import check_state, without_warnings
from crosscheck.engines.shared.driver_motion import motion, stated_rate
from crosscheck.engines.shared.sampling import Adaptive, Counts, Failed, Sample, step_count
from crosscheck.engines.shared.tree_reactions import LinkMotion, joint_reactions, wrench
from crosscheck.judge.pieces import at_start
from crosscheck.judge.time_functions import next_end
from crosscheck.setting import unknown_family
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Coupling, Driver, Joint, Scene

# rad; largest motion of a driver in an adaptive step, since closures may change branch within larger ones
TURN_PER_STEP = 0.25


class Simulation:
    """One simulation: a model, its data and the method by which they are advanced."""

    def __init__(self, scene: Scene, setting: Setting, switched: Sequence[Joint | Coupling] = ()):
        import mujoco

        self.mujoco, self.scene, self.setting = mujoco, at_start(scene), setting
        self.compiled = compiled(scene, switched)
        self.model = self.compiled.model
        self.counts = Counts()
        self.turned = np.array([body.orientation for body in scene.body])
        self._configure(setting, scene)
        self.data = mujoco.MjData(self.model)
        self.data.qvel[:] = self.compiled.rates
        self.data.xfrc_applied[:], self.data.qfrc_applied[:] = self.compiled.applied, self.compiled.pushed
        self.since = 0.0  # s, from which the pieces of functions of time act

    def _configure(self, setting: Setting, scene: Scene) -> None:
        model, options, mujoco = self.model, setting.options, self.mujoco
        self.nominal = options.get("step", DEFAULT_STEP)
        model.opt.timestep = self.nominal
        self.step = self._fixed
        self.forwards, self.parts = int(options.get("forward", 1)), bool(options.get("parts", False))
        if setting.family == "defaults":
            change_options(mujoco, model, options)
            return
        if setting.family == CHOSEN:
            self._choose(options)
            return
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        model.opt.integrator = getattr(mujoco.mjtIntegrator, STOCK.get(setting.family, RK4))
        # sparse factors of MuJoCo 4.0.0 are wrong for some trees
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
        if setting.family in STOCK:
            model.eq_solref[:], model.eq_solimp[:] = (2 * self.nominal, 1.0), STIFFEST
            own = {name: options[name] for name in SOLVING if name in options}
            change_options(mujoco, model, own)
        elif setting.family in ("tuned", "stiff", *INTEGRATED_HERE):
            self._harden(options.get("beta", 0.0), options.get("hard", HARD))
        else:
            raise unknown_family("mujoco", setting.family)
        turn = options.get("turn", TURN_PER_STEP)
        self.longest = turn / stated_rate(scene) if scene.driver else np.inf
        if setting.family in COMPILED:
            compiled_run.leave_out_unused(mujoco, model)
        elif setting.family in ADAPTIVE:
            limits = (options["min_step"], self.longest)
            settle = self._settle if setting.family == "projected" else None
            self.adaptive = Adaptive(self._rhs, settle, options["rtol"], *limits, self.counts)
            self.step = self._adaptively

    def _harden(self, beta: float, factor: float) -> None:
        """Set closures such that their errors decay as exp(-beta t), and scale the regulariser by a
        factor."""
        model = self.model
        model.eq_solref[:], model.eq_solimp[:] = (-(beta**2), -2 * beta), STIFFEST
        model.body_invweight0[:] *= factor
        model.dof_invweight0[:] *= factor
        model.opt.tolerance, model.opt.iterations = CONVERGED, MOST_ITERATIONS
        model.opt.disableflags |= self.mujoco.mjtDisableBit.mjDSBL_REFSAFE

    def _choose(self, options: Mapping[str, Any]) -> None:
        """Set the solver, Jacobian, islands and warm start that the options name."""
        if "hard" in options:
            self._harden(options["beta"], options["hard"])
        self.model.opt.tolerance = float(options.get("tolerance", CONVERGED))
        bits = self.mujoco.mjtDisableBit
        for name, bit in (("islands", bits.mjDSBL_ISLAND), ("warm", bits.mjDSBL_WARMSTART)):
            if not options.get(name, True):
                self.model.opt.disableflags |= bit
        change_options(self.mujoco, self.model, options)

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Install this run's callbacks in MuJoCo, whose callbacks are global in the process, until the run
        ends."""
        mujoco = self.mujoco
        try:
            with without_warnings(mujoco):
                if self.compiled.drivers or self.compiled.timed:
                    mujoco.set_mjcb_control(self._drive)
                yield
        finally:
            mujoco.set_mjcb_control(None)

    def integrated(self, times: np.ndarray, start: float, labels: dict[str, Any]) -> Trajectory:
        """Return the run of a compiled family; its construction began at ``start`` (s of CPU time)."""
        family, options = self.setting.family, self.setting.options
        run = compiled_run.compiled_run(self.scene, self.compiled, self.data, family, options, self.longest)
        built = time.process_time() - start
        return run.trajectory(self.scene, times, self.sample, built, labels)

    def rows(self, equality: int) -> np.ndarray:
        """Return the constraint rows of an equality at this step; MuJoCo leaves out rows that no coordinate
        moves."""
        data, kind = self.data, int(self.mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        return np.flatnonzero((data.efc_type == kind) & (data.efc_id == equality))

    def driven(self) -> list[tuple[int, Driver]]:
        """Return the rows of the drivers at this step."""
        return [(int(row), d) for equality, d in self.compiled.drivers for row in self.rows(equality)[:1]]

    def _drive(self, model: Any, data: Any) -> None:
        """Add drivers' motion to the reference accelerations of their rows; apply loads over time."""
        if self.compiled.timed:
            self.compiled.apply(data, self.since)
        reference, gains = data.efc_aref, data.efc_KBIP
        for row, driver in self.driven():
            value, rate, acceleration = motion(driver, data.time, self.since)
            stiffness, damping, impedance, _ = gains[row]
            reference[row] += acceleration + damping * rate + stiffness * impedance * value

    def advance(self, t0: float, t1: float) -> None:
        """Move the data from t0 to t1, with pieces of functions of time in turn; raises Failed."""
        t = t0
        try:
            while t < t1:
                self.since, stop = t, min(t1, next_end(self.scene, t))
                self.step(t, stop)
                t = self.since = self.data.time = stop
        except self.mujoco.FatalError as error:
            raise Failed(Outcome.STEP_FAILED, t, f"MuJoCo stopped after {t:.6g} s: {error}") from error
        self.data.time = t1
        check_state(self.mujoco, self.data, t0, t1)

    def _fixed(self, t0: float, t1: float) -> None:
        n = step_count(t0, t1, self.nominal)
        self.model.opt.timestep = (t1 - t0) / n
        if self.parts:
            for _ in range(n):
                self.mujoco.mj_step1(self.model, self.data)
                self.mujoco.mj_step2(self.model, self.data)
        else:
            self.mujoco.mj_step(self.model, self.data, nstep=n)
        rk4 = self.model.opt.integrator == self.mujoco.mjtIntegrator.mjINT_RK4
        self.counts.steps += n
        self.counts.rhs += 4 * n if rk4 else n

    def _adaptively(self, t0: float, t1: float) -> None:
        y = self.adaptive.advance(np.concatenate((self.data.qpos, self.data.qvel)), t0, t1)
        self._load(t1, y)
        self.mujoco.mj_normalizeQuat(self.model, self.data.qpos)

    def _load(self, t: float, y: np.ndarray) -> None:
        self.data.time = t
        self.data.qpos[:], self.data.qvel[:] = y[: self.model.nq], y[self.model.nq :]

    def _rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the time derivative (nq + nv,) of positions and velocities."""
        model, data = self.model, self.data
        self._load(t, y)
        self.mujoco.mj_forward(model, data)
        return np.concatenate((self._position_rates(data.qpos, data.qvel), data.qacc))

    def _settle(self, t: float, y: np.ndarray) -> np.ndarray:
        return projected(self.mujoco, self.model, self.data, self.driven, t, self._load, y)

    def _position_rates(self, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        model = self.model
        if model.nq == model.nv:
            return qvel
        rates = np.empty(model.nq)
        free, ball = (int(k) for k in (self.mujoco.mjtJoint.mjJNT_FREE, self.mujoco.mjtJoint.mjJNT_BALL))
        places = (model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist())
        for kind, q, v in zip(*places, strict=True):
            moved = {free: 3, ball: 0}.get(kind, 1)
            rates[q : q + moved] = qvel[v : v + moved]
            if kind in (free, ball):
                omega = np.concatenate(([0.0], qvel[v + moved : v + moved + 3]))
                unit = qpos[q + moved : q + moved + 4]
                rates[q + moved : q + moved + 4] = rotations.multiply(unit / np.linalg.norm(unit), omega) / 2
        return rates

    def sample(self, t: float) -> Sample:
        """Return poses, velocities and reactions of the scene's bodies and joints."""
        self.since = t
        scene, tree = self.scene, self.compiled.tree
        motion = self.link_motion()
        own = list(tree.own)
        quaternions = self.data.xquat[self.compiled.links]
        return Sample(
            position=motion.position[own],
            orientation=rotations.multiply(quaternions[own], self.turned),
            velocity=motion.velocity[own],
            angular_velocity=motion.angular_velocity[own],
            acceleration=motion.acceleration[own],
            angular_acceleration=motion.angular_acceleration[own],
            reactions=joint_reactions(scene, tree, motion, self.closing()) if scene.has_mass() else {},
        )

    def link_motion(self) -> LinkMotion:
        """Return the motion of the links; afterwards the data's forces belong to this state."""
        mujoco, model, data, links = self.mujoco, self.model, self.data, self.compiled.links
        for _ in range(self.forwards):
            mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        twists, changes = np.zeros((2, len(links), 6))
        for twist, change, body in zip(twists, changes, links, strict=True):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 0)
            mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, change, 0)
        # MuJoCo counts gravity as an upward acceleration of the world; up to 3.17 not of a body fixed to it
        acceleration = changes[:, 3:] + model.opt.gravity
        acceleration[model.body_weldid[links] == 0] = 0.0
        return LinkMotion(
            rotation=data.xmat[links].reshape(-1, 3, 3),
            position=data.xpos[links],
            velocity=twists[:, 3:],
            angular_velocity=twists[:, :3],
            acceleration=acceleration,
            angular_acceleration=changes[:, :3],
            coordinates=self._coordinates(),
            rates=data.qvel.copy(),
            time=float(data.time),
        )

    def _coordinates(self) -> np.ndarray:
        """Return coordinates (nv,) in the order of the velocities; zero for joints without angles."""
        model, coordinates = self.model, np.zeros(self.model.nv)
        single = np.isin(model.jnt_type, [int(k) for k in self.compiled.single])
        coordinates[model.jnt_dofadr[single]] = self.data.qpos[model.jnt_qposadr[single]]
        return coordinates

    def closing(self) -> list[np.ndarray]:
        """Return the wrench on the second link of each closure of the tree."""
        data, tree, wrenches = self.data, self.compiled.tree, []
        for k, closure in enumerate(tree.closures):
            if closure.kind == "point":
                rows = self.rows(self.model.equality(f"closure {k}").id)
                point = data.site(f"closure {k}.1").xpos
                wrenches.append(wrench(-data.efc_force[rows] if len(rows) else np.zeros(3), point))
            else:
                ghost = self.compiled.links[closure.links[1]]
                about = data.subtree_com[self.model.body_rootid[ghost]]
                wrenches.append(wrench(data.cfrc_ext[ghost, 3:], about, data.cfrc_ext[ghost, :3]))
        return wrenches
