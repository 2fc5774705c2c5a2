"""One-line defects to plant, each with the tests that have to see it.

Chosen for what a report would silently get wrong: signs, factors, phases and frames in the equations,
exchanged options, units, labels and cells, least against median and wall against processor time, keys,
samples and order of records, checks at the doors.  Where two places compute the same (kernel, adapter,
judge), each has its own.
"""

from __future__ import annotations

from typing import NamedTuple

MBREF, JUDGE = "tests/mbref/test_by_hand.py", "tests/crosscheck/test_by_hand.py"
REPORTS, SECTIONS = "tests/reports/test_by_hand.py", "tests/reports/test_sections.py"
SCENE, RECORDS = "tests/mbref/test_scene.py", "tests/mbref/test_records.py"
LIMITS, CACHES = "tests/mbref/test_limits.py", "tests/mbref/test_caches.py"
ANSWERS, METRICS = "tests/crosscheck/test_answers.py", "tests/crosscheck/test_metrics.py"
KINEMATICS, FORMULAS = "tests/crosscheck/test_kinematics.py", "tests/mbref/test_formulations.py"
RICHARDSON, GAUSS = "tests/crosscheck/test_limits.py", "tests/crosscheck/test_gauss.py"
PRIMITIVES = "tests/properties/test_primitives.py"
TREE, STUDY = "tests/crosscheck/test_tree_engines.py", "tests/crosscheck/test_study.py"

P, L = "mbref/equations/primitives.py", "mbref/equations/loads.py"
D, T = "crosscheck/engines/driver_motion.py", "crosscheck/judge/joint_residuals.py"
M, E = "crosscheck/judge/metrics.py", "crosscheck/judge/energy.py"
A, R = "crosscheck/processes/answer.py", "mbref/records.py"
G, RE = "crosscheck/study/grid.py", "crosscheck/engines/tree_reactions.py"
V, F = "mbref/scene_validation.py", "mbref/scene_fields.py"


class Defect(NamedTuple):
    """``old``, which the file has once, becomes ``new``; ``tests`` have to fail."""

    file: str
    old: str
    new: str
    tests: str


DEFECTS = (
    # equations of mbref
    Defect(P, "argument = frequency * t + drivers.phase[d]", "argument = frequency * t", MBREF),
    Defect(
        P, "acceleration = acceleration * t + 2.0 * rate", "acceleration = acceleration * t + rate", MBREF
    ),
    Defect(P, "rate += amplitude * frequency * cos(argument)", "rate += amplitude * cos(argument)", MBREF),
    Defect(
        P,
        "acceleration -= amplitude * frequency * frequency * sin(argument)",
        "acceleration += amplitude * frequency * frequency * sin(argument)",
        MBREF,
    ),
    Defect(
        P,
        "return direction, scale(-rate, along), second",
        "return direction, scale(rate, along), second",
        MBREF,
    ),
    Defect(
        P,
        "second = subtract(scale(-acceleration, along), scale(rate * rate, direction))",
        "second = add(scale(-acceleration, along), scale(rate * rate, direction))",
        PRIMITIVES,
    ),
    Defect(
        P,
        "+ 2.0 * dot(to_world(rotation, i, turn_i), to_world(rotation, j, turn_j))",
        "+ dot(to_world(rotation, i, turn_i), to_world(rotation, j, turn_j))",
        PRIMITIVES,
    ),
    Defect(
        P,
        "put(blocks, row + k, 3, cross(s_i, to_body(a, i, world)))",
        "put(blocks, row + k, 3, cross(s_j, to_body(a, i, world)))",
        PRIMITIVES,
    ),
    Defect(
        L,
        "accumulate(g, 6 * b + 3, cross(point, to_body(frames.rotation, b, force)))",
        "accumulate(g, 6 * b + 3, cross(point, force))",
        "tests/crosscheck/test_constraints.py",
    ),
    Defect(
        L,
        "gyroscopic = cross((inertia[b, 0] * w[0], inertia[b, 1] * w[1], inertia[b, 2] * w[2]), w)",
        "gyroscopic = cross(w, (inertia[b, 0] * w[0], inertia[b, 1] * w[1], inertia[b, 2] * w[2]))",
        MBREF,
    ),
    Defect(L, "+ loads.damping[k] * rate\n        force", "- loads.damping[k] * rate\n        force", MBREF),
    Defect(L, "push(j, s_j, scale(-1.0, force), frames, g)", "push(j, s_j, force, frames, g)", MBREF),
    Defect(
        L,
        "loads.stiffness[k] * (angle - loads.natural[k])",
        "loads.stiffness[k] * (angle + loads.natural[k])",
        MBREF,
    ),
    Defect(L, "rate = dot(subtract(w_j, w_i), axis)", "rate = dot(subtract(w_i, w_j), axis)", MBREF),
    Defect(
        L,
        "accumulate(g, 6 * i + 3, to_body(rotation, i, scale(-1.0, moment)))",
        "accumulate(g, 6 * i + 3, to_body(rotation, i, moment))",
        MBREF,
    ),
    Defect(
        L,
        "accumulate(g, 6 * body + 3, to_body(frames.rotation, body, vector(loads.force, k)))",
        "accumulate(g, 6 * body + 3, vector(loads.force, k))",
        MBREF,
    ),
    Defect(
        "mbref/stabilisation/baumgarte.py",
        'return 2 * options["alpha"], options["beta"] ** 2',
        'return 2 * options["beta"], options["alpha"] ** 2',
        MBREF,
    ),
    Defect(
        "mbref/equations/joint_reactions.py",
        "sign = np.where(side == 1, 1.0, -1.0)",
        "sign = np.where(side == 1, 1.0, 1.0)",
        MBREF,
    ),
    Defect("mbref/equations/joint_reactions.py", "- np.cross(arm, force)", "+ np.cross(arm, force)", MBREF),
    Defect(
        "mbref/formulations/lm1.py",
        "system.acceleration[j] = b[j] * root[j]",
        "system.acceleration[j] = b[j]",
        FORMULAS,
    ),
    Defect("mbref/formulations/lm1.py", "multipliers[i] *= b[n + i]", "multipliers[i] = b[n + i]", FORMULAS),
    # doors of mbref
    Defect(V, "tolerance = INERTIA_TOLERANCE", "tolerance = 1e9 * INERTIA_TOLERANCE", SCENE),
    Defect(
        V,
        "if moments[2] > moments[0] + moments[1] + tolerance:",
        "if moments[2] > moments[0] + moments[1] + 9:",
        SCENE,
    ),
    Defect(V, "amplitude * math.sin(phase)\n    return", "amplitude * math.cos(phase)\n    return", MBREF),
    Defect(V, 'RESERVED = (GROUND, "the fixed frame")', "RESERVED = (GROUND,)", SCENE),
    Defect(F, "if value < SMALLEST:", "if value < 0:", SCENE),
    Defect(F, "if abs(value) > LARGEST:", "if value > 1e300:", SCENE),
    Defect("mbref/scene.py", 'encoding="utf-8-sig"', 'encoding="utf-8"', SCENE),
    Defect(
        "mbref/simulation/limits.py", '"rtol": (FINEST, 0.99, False)', '"rtol": (FINEST, 0.99, True)', LIMITS
    ),
    Defect(
        "mbref/simulation/limits.py",
        "object.__setattr__(self, field.name, _checked",
        "(lambda *_: None)(self, field.name, _checked",
        LIMITS,
    ),
    Defect("mbref/simulation/limits.py", "isinstance(value, str | bool)", "isinstance(value, str)", LIMITS),
    Defect("mbref/cli/options.py", '.replace("largest_step", "max-step")', "", LIMITS),
    # records and caches
    Defect(
        R,
        'record["key"]: record for record in lines',
        'record["key"]: record for record in lines[::-1]',
        RECORDS,
    ),
    Defect(R, "os.truncate(path, end)", "os.truncate(path, 0)", RECORDS),
    Defect(R, "if text and len(foreign) == len(lines):", "if False:", RECORDS),
    Defect(R, "file.truncate(before)", "pass", RECORDS),
    Defect(R, "enumerate(lines, 1)", "enumerate(lines)", RECORDS),
    Defect(R, "parse_constant=_refused", "parse_constant=float", RECORDS),
    Defect(
        "mbref/kernels/checked_file.py", "if hashlib.sha256(data).digest() == digest:", "if data:", CACHES
    ),
    Defect("mbref/kernels/checked_file.py", "os.replace(temporary, path)", "path.write_bytes(data)", CACHES),
    # adapters and processes
    Defect(D, "sine.frequency * t + sine.phase", "sine.frequency * t", JUDGE),
    Defect(D, "acceleration = acceleration * t + 2 * rate", "acceleration = acceleration * t + rate", JUDGE),
    Defect(D, "acceleration -= sine.amplitude * w * w", "acceleration -= sine.amplitude * w", JUDGE),
    Defect(
        "crosscheck/engines/sampling.py", "start = time.process_time()", "start = time.perf_counter()", JUDGE
    ),
    Defect(
        "crosscheck/engines/sampling.py",
        "seconds += time.process_time() - start",
        "seconds = time.process_time() - start",
        JUDGE,
    ),
    Defect(
        "crosscheck/engines/sampling.py",
        "Cost(seconds, build_seconds,",
        "Cost(seconds + build_seconds, build_seconds,",
        JUDGE,
    ),
    Defect(A, "np.array_equal(reached, times[: reached.size])", "True", ANSWERS),
    Defect(A, "reached.size < times.size:", "reached.size < 0:", ANSWERS),
    Defect(A, "array.shape != shape", "array.ndim != len(shape)", ANSWERS),
    Defect(A, 'x if n.endswith("seconds") else int(x)', "x", ANSWERS),
    # reactions of the tree engines
    Defect(RE, "+ load.damping * rate)\n    axis", ")\n    axis", TREE),
    Defect(RE, "link, joint.anchor_pair[1])", "link, joint.anchor_pair[0])", TREE),
    Defect(RE, "if child_is_second else -carried[k]", "if child_is_second else carried[k]", TREE),
    Defect(RE, "np.cross(omega, inertia @ omega)", "np.cross(inertia @ omega, omega)", TREE),
    Defect(RE, "force = force + rod.mass / 2 *", "force = force + rod.mass *", TREE),
    Defect("crosscheck/study/timings.py", "if any(records[i]", "if all(records[i]", STUDY),
    Defect(G, "list(map(float, case.times)), case.engine", "len(case.times), case.engine", STUDY),
    Defect(G, "_version(case.engine),\n", '"",\n', STUDY),
    Defect(G, "dict(case.setting.options),\n    ]", "\n    ]", STUDY),
    # judge
    Defect(T, "driver.sine.phase + derivative", "derivative", JUDGE),
    Defect(T, "driver.sine.amplitude * w**derivative", "driver.sine.amplitude * w", JUDGE),
    Defect(T, "- 2 * np.cross(w[0], dv)", "- np.cross(w[0], dv)", KINEMATICS),
    Defect(
        T,
        "(_dot(offset, da) + _dot(dv, dv) - along**2)",
        "(_dot(offset, da) + _dot(dv, dv) + along**2)",
        JUDGE,
    ),
    Defect(T, "dw[1] - dw[0] - np.cross(w[0], w[1])", "dw[1] - dw[0]", KINEMATICS),
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
    Defect(M, 'Metric(_violation(1), "rad/s"', 'Metric(_violation(1), "rad/s²"', JUDGE),
    Defect(M, '"scd": Metric(_correct_digits, "digits"', '"scd": Metric(_correct_digits, ""', JUDGE),
    Defect(M, "np.isfinite(series).all() else math.inf", "np.isfinite(series).all() else 0.0", METRICS),
    Defect(M, "(length * trajectory.angular_velocity,", "(trajectory.angular_velocity,", METRICS),
    Defect(E, "np.abs(gains.sum(axis=0)) / scale", "np.abs(gains.max(axis=0)) / scale", METRICS),
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
    Defect("crosscheck/study/fair_timing.py", '"seconds": min(finite)', '"seconds": median(finite)', JUDGE),
    Defect("crosscheck/study/fair_timing.py", '"median": median(finite)', '"median": min(finite)', JUDGE),
    Defect("crosscheck/study/fair_timing.py", '"repeats": len(finite)', '"repeats": len(seconds)', JUDGE),
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
        "reports/sections/speed.py",
        "(max(r.error, SMALLEST), max(r.seconds, UNTIMED))",
        "(max(r.error, SMALLEST), max(r.t_end, UNTIMED))",
        REPORTS,
    ),
    Defect(
        "reports/runs.py",
        "return self.completed and self.error > WRONG",
        "return self.error > WRONG",
        SECTIONS,
    ),
)
