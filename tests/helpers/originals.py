"""Imported scenes against the original models, whose matrices by MuJoCo are integrated finely."""

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.engines.mujoco.importing.reading import Source
from crosscheck.judge.gauss_motion import gauss_motion
from mbref import rotations

OFF = ("CONTACT", "LIMIT", "FRICTIONLOSS", "REFSAFE")
NO_SOFTNESS = -1e-300  # stiffness and damping of closures: reference accelerations are those of exact joints
RTOL, RANK = 1e-13, 1e-9  # of the integrations; of the rank of rows
ROUNDED = 1e-10  # m or rad: a shorter row is of two points on one body, or on bodies fixed together
LEAST = 1e-4  # m: a shorter way is of a structure whose loops leave no motion


def own_motion(model, found: Source, times, key: int = -1) -> np.ndarray:
    """Centres of mass (k, nb, 3) by MuJoCo from the file's terms; ``key`` is the controls' keyframe."""
    for name in OFF:
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")
    model.opt.jacobian, model.eq_solref[:] = mujoco.mjtJacobian.mjJAC_DENSE, NO_SOFTNESS
    data, groups = mujoco.MjData(model), found.groups
    if key >= 0:
        data.ctrl[:] = model.key_ctrl[key]
    turns = [
        (int(q) + 3 * (k == 0), int(v) + 3 * (k == 0))
        for k, q, v in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True)
        if k < 2  # free joints and balls
    ]
    single = np.setdiff1d(np.arange(model.nq), [q + i for q, _ in turns for i in range(4)])
    rates = np.setdiff1d(np.arange(model.nv), [v + i for _, v in turns for i in range(3)])

    def rhs(t, y):
        data.qpos[:], data.qvel[:] = y[: model.nq], y[model.nq :]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        moved = np.zeros(model.nq)
        moved[single] = data.qvel[rates]
        for q, v in turns:
            spin = np.concatenate([[0.0], data.qvel[v : v + 3]])
            moved[q : q + 4] = rotations.multiply(data.qpos[q : q + 4], spin) / 2
        return np.concatenate([moved, _accelerations(model, data)])

    start = np.concatenate([found.qpos, found.qvel])
    run = solve_ivp(rhs, (0.0, times[-1]), start, "DOP853", times, rtol=RTOL, atol=1e-13)
    places = []
    for y in run.y.T:
        data.qpos[:] = y[: model.nq]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        places.append([groups.placed(data, g).position for g in groups.pieces])
    return np.array(places)


def _of_polynomials(model, data) -> np.ndarray:
    """P''(q) q̇² (nefc,) of equalities of two joints, which MuJoCo's reference accelerations leave out."""
    found = np.zeros(data.nefc)
    for e in np.flatnonzero((model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_obj2id >= 0)):
        place, rate = (at[model.eq_obj2id[e]] for at in (model.jnt_qposadr, model.jnt_dofadr))
        moved = data.qpos[place] - model.qpos0[place]
        bend = np.polynomial.Polynomial(model.eq_data[e, :5]).deriv(2)(moved) * data.qvel[rate] ** 2
        found[(data.efc_id[: data.nefc] == e) & (data.efc_type[: data.nefc] == 0)] = bend
    return found


def _accelerations(model, data) -> np.ndarray:
    """q̈ (nv,) with M q̈ + c = τ + Jᵀλ and J q̈ = -J̇ q̇; coordinates that no inertia resists stay."""
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    held = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    rows = data.efc_J[: data.nefc * model.nv].reshape(data.nefc, model.nv)
    held &= np.linalg.norm(rows, axis=1) > ROUNDED
    rows = rows[held]
    root = np.linalg.cholesky(mass)
    free = np.linalg.solve(mass, data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias)
    weighted = np.linalg.solve(root, rows.T).T
    missing = (data.efc_aref[: data.nefc] + _of_polynomials(model, data))[held] - rows @ free
    return free + np.linalg.solve(root.T, np.linalg.pinv(weighted, rcond=RANK) @ missing)


def apart(model, found: Source, end: float, key: int = -1) -> float:
    """Largest difference of a body's place between scene and original model, over the largest way moved."""
    times = (0.0, end / 2, end)
    run = gauss_motion(found.imported.scene, times, RTOL)
    moved = np.linalg.norm(run.position - run.position[0], axis=-1).max()
    moved = max(moved, LEAST)
    off = np.linalg.norm(run.position - own_motion(model, found, times, key), axis=-1).max()
    return float(off / moved)
