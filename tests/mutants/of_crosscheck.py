"""One-line defects in crosscheck and reports, the tests that have to see each; why these: ``defects.py``."""

from __future__ import annotations

from tests.mutants.defect import Defect

BY_HAND, ANSWERS, METRICS = (f"tests/crosscheck/test_{name}.py" for name in ("by_hand", "answers", "metrics"))
KINEMATICS, RICHARDSON, GAUSS = (
    f"tests/crosscheck/test_{name}.py" for name in ("kinematics", "limits", "gauss")
)
TREE, STUDY, REFERENCE = (
    f"tests/crosscheck/test_{name}.py" for name in ("tree_engines", "study", "reference")
)
KEYS = f"{STUDY}::test_keys_of_different_cases_differ"
FEATURES = f"{REFERENCE}::test_formulations_agree_on_every_feature"
REPORTS, SECTIONS = "tests/reports/test_by_hand.py", "tests/reports/test_sections.py"
D, T = "crosscheck/engines/driver_motion.py", "crosscheck/judge/joint_residuals.py"
M, E = "crosscheck/judge/metrics.py", "crosscheck/judge/energy.py"
A, G, RE = (f"crosscheck/{name}.py" for name in ("processes/answer", "study/grid", "engines/tree_reactions"))

DEFECTS = (  # adapters and processes
    Defect(D, "sine.frequency * t + sine.phase", "sine.frequency * t", BY_HAND),
    Defect(
        D, "acceleration = acceleration * t + 2 * rate", "acceleration = acceleration * t + rate", BY_HAND
    ),
    Defect(D, "acceleration -= sine.amplitude * w * w", "acceleration -= sine.amplitude * w", BY_HAND),
    Defect(
        "crosscheck/engines/sampling.py",
        "start = time.process_time()",
        "start = time.perf_counter()",
        BY_HAND,
    ),
    Defect(
        "crosscheck/engines/sampling.py",
        "seconds += time.process_time() - start",
        "seconds = time.process_time() - start",
        BY_HAND,
    ),
    Defect(
        "crosscheck/engines/sampling.py",
        "Cost(seconds, build_seconds,",
        "Cost(seconds + build_seconds, build_seconds,",
        BY_HAND,
    ),
    Defect(A, "np.array_equal(reached, times[: reached.size])", "True", ANSWERS),
    Defect(A, "reached.size < times.size:", "reached.size < 0:", ANSWERS),
    Defect(A, "array.shape != shape", "array.ndim != len(shape)", ANSWERS),
    Defect(A, 'x if n.endswith("seconds") else int(x)', "x", ANSWERS),
    # reactions of the tree engines
    Defect(RE, "+ load.damping * rate)\n    axis", ")\n    axis", TREE),
    Defect(RE, "link, joint.anchor_pair[1])", "link, joint.anchor_pair[0])", TREE),
    Defect(RE, "if child_is_second else -carried[k]", "if child_is_second else carried[k]", TREE),
    Defect(RE, "cross(omega, inertia @ omega)", "cross(inertia @ omega, omega)", TREE),
    Defect(RE, "force = force + rod.mass / 2 *", "force = force + rod.mass *", TREE),
    Defect(
        "crosscheck/study/timings.py",
        "if any(records[i]",
        "if all(records[i]",
        f"{STUDY}::test_timing_goes_on_where_one_of_a_scene_is_missing",
    ),
    Defect(G, "list(map(float, case.times)), case.engine", "len(case.times), case.engine", KEYS),
    Defect(G, "_version(case.engine),\n", '"",\n', f"{STUDY}::test_key_of_another_version_differs"),
    Defect(G, "dict(case.setting.options),\n    ]", "\n    ]", KEYS),
    # judge
    Defect(T, "driver.sine.phase + derivative", "derivative", BY_HAND),
    Defect(T, "driver.sine.amplitude * w**derivative", "driver.sine.amplitude * w", BY_HAND),
    Defect(T, "- 2 * cross(w[0], dv)", "- cross(w[0], dv)", KINEMATICS),
    Defect(
        T,
        "(_dot(offset, da) + _dot(dv, dv) - along**2)",
        "(_dot(offset, da) + _dot(dv, dv) + along**2)",
        BY_HAND,
    ),
    Defect(T, "dw[1] - dw[0] - cross(w[0], w[1])", "dw[1] - dw[0]", KINEMATICS),
    Defect(
        M,
        "return distance.max(axis=-1) / constraints",
        "return distance.mean(axis=-1) / constraints",
        METRICS,
    ),
    Defect(
        M,
        "trajectory.orientation, exact.orientation).max(axis=-1)",
        "trajectory.orientation, exact.orientation).min(axis=-1)",
        METRICS,
    ),
    Defect(M, "np.where(are_lengths[name], length, 1.0)", "length", METRICS),
    Defect(M, 'Metric(_violation(1), "rad/s"', 'Metric(_violation(1), "rad/s²"', BY_HAND),
    Defect(M, '"scd": Metric(_correct_digits, "digits"', '"scd": Metric(_correct_digits, ""', BY_HAND),
    Defect(M, "np.isfinite(series).all() else math.inf", "np.isfinite(series).all() else 0.0", METRICS),
    Defect(M, "(length * trajectory.angular_velocity,", "(trajectory.angular_velocity,", METRICS),
    Defect(E, "np.abs(gains.sum(axis=0))", "np.abs(gains.max(axis=0))", METRICS),
    Defect(E, "turning) / 2", "turning)", METRICS),
    Defect(
        "crosscheck/judge/richardson.py",
        "weight = 1 / ((h2 / h3) ** order - 1)",
        "weight = 1 / ((h2 / h3) ** order + 1)",
        RICHARDSON,
    ),
    Defect(
        "crosscheck/judge/gauss_principle.py",
        "load.damping * rate - load.stiffness * load.natural_angle",
        "load.damping * rate + load.stiffness * load.natural_angle",
        GAUSS,
    ),
    # study and reports
    Defect("crosscheck/study/fair_timing.py", '"seconds": min(finite)', '"seconds": median(finite)', BY_HAND),
    Defect("crosscheck/study/fair_timing.py", '"median": median(finite)', '"median": min(finite)', BY_HAND),
    Defect("crosscheck/study/fair_timing.py", '"repeats": len(finite)', '"repeats": len(seconds)', BY_HAND),
    Defect(
        "reports/sections/outcomes.py",
        'str(cost["steps"]), str(cost["rhs"])',
        'str(cost["rhs"]), str(cost["steps"])',
        REPORTS,
    ),
    Defect(
        "reports/runs.py",
        "return error_text(self.record)",
        'return power(self.metric("position_error"))',
        REPORTS,
    ),
    Defect("reports/sections/outcomes.py", "duration(run.seconds)", "duration(run.t_end)", REPORTS),
    Defect(
        "reports/sections/outcomes.py", 'f" ({run.outcome.letter})"', 'f" ({run.outcome.label})"', REPORTS
    ),
    Defect(
        "reports/sections/speed.py",
        'ylabel="time of stepping (s)"',
        'ylabel="time of stepping (ms)"',
        REPORTS,
    ),
    Defect(
        "reports/runs.py",
        "return drawn(self.record, self.seconds)",
        "return drawn(self.record, self.t_end)",
        REPORTS,
    ),
    Defect(
        "reports/runs.py",
        "return self.completed and self.error > WRONG",
        "return self.error > WRONG",
        f"{SECTIONS}::test_completed_and_failed_runs_apart",
    ),
    # as a second reader would: adapters, reference A and B, bounds, study, sections
    Defect("crosscheck/engines/mujoco/model.py", "joint.damping[0] += load.damping", "pass", TREE),
    Defect(
        "crosscheck/engines/mujoco/model.py",
        "axes[:, 2] *= np.sign(np.linalg.det(axes))",
        "axes[:, 2] *= 1.0",
        "tests/crosscheck/test_mujoco.py",
    ),
    Defect(
        "crosscheck/engines/exudyn/reactions.py",
        "found[joint.name][:, part] -= forces[:, at + n, None] * axis",
        "found[joint.name][:, part] += forces[:, at + n, None] * axis",
        "tests/crosscheck/test_exudyn_reactions.py",
    ),
    Defect(
        "crosscheck/engines/mbref.py",
        'code = "generated" if setting.family.endswith(GENERATED) else "generic"',
        'code = "generic"',
        BY_HAND,
    ),
    Defect(
        "crosscheck/judge/reference/natural.py",
        "np.trace(inertia) / 2 * EYE - inertia",
        "np.trace(inertia) * EYE - inertia",
        FEATURES,
    ),
    Defect(
        "crosscheck/judge/reference/natural_loads.py",
        "self._rate[k - 1] = k * self._length[k]",
        "self._rate[k - 1] = self._length[k]",
        FEATURES,
    ),
    Defect(
        "crosscheck/judge/reference/tree_loads.py",
        "turning = cross(spin, apply(inertia, spin)) + apply(",
        "turning = apply(",
        FEATURES,
    ),
    Defect(
        "crosscheck/judge/reference/tree_equations.py",
        "- frequency * frequency * wave",
        "- frequency * wave",
        FEATURES,
    ),
    Defect("crosscheck/judge/reference/bound.py", "np.maximum.accumulate(apart)", "apart", BY_HAND),
    Defect(
        "crosscheck/judge/reaction_balance.py",
        "np.hstack([mass * exact.acceleration[k], turning]) - applied(",
        "np.hstack([mass * exact.acceleration[k], turning]) + applied(",
        "tests/crosscheck/test_reactions.py",
    ),
    Defect(
        "crosscheck/study/difference.py",
        "return high > ratio * low",
        "return high > low",
        BY_HAND,
    ),
    Defect(
        "reports/sections/least_errors.py",
        "sum(least.is_reached for least in found)",
        "len(found)",
        f"{SECTIONS}::test_least_errors_of_the_records",
    ),
    Defect(
        "reports/sections/reactions.py",
        "time = next(iter(runs.values())).times[samples // 2]",
        "time = next(iter(runs.values())).times[-1]",
        "tests/reports/test_between_engines.py",
    ),
    Defect(
        "reports/sections/verdict.py",
        "lines = [run.said, duration(run.seconds)]",
        "lines = [run.said, duration(run.t_end)]",
        "tests/reports/test_first_screen.py",
    ),
    Defect(
        "reports/runs.py",
        "return self.completed and self.error > EXCESS * rtol",
        "return self.completed and self.error > rtol",
        f"{SECTIONS}::test_errors_and_the_tolerances_asked_for",
    ),
)
