"""One-line defects in mbref, and the tests that have to see each; why these: ``defects.py``."""

from __future__ import annotations

from tests.mutants.defect import Defect

BY_HAND, SCENE, RECORDS = (f"tests/mbref/test_{name}.py" for name in ("by_hand", "scene", "records"))
LIMITS, CACHES, FORMULAS = (f"tests/mbref/test_{name}.py" for name in ("limits", "caches", "formulations"))
ENSEMBLE = "tests/mbref/test_ensemble.py"
CLOSED_FORMS = "tests/mbref/test_taylor_closed_forms.py"
THRESHOLDS = "tests/mbref/interpreted_thresholds.py"
BY_POWER = "tests/mbref/test_generated_code.py::test_power_gives_the_terms_of_one_freedom"
CROSSINGS = "tests/mbref/test_singular_crossing.py"
SHORT = "tests/mbref/test_short_crossings.py::test_other_motions_are_judged_by_a_perturbed_run"
PRIMITIVES = "tests/properties/test_primitives.py"
P, L = "mbref/equations/primitives.py", "mbref/equations/loads.py"
V, F, R = "mbref/scene_validation.py", "mbref/scene_fields.py", "mbref/records.py"
TL, TS = "mbref/taylor/loads.py", "mbref/taylor/samples.py"

DEFECTS = (
    # equations of mbref
    Defect(P, "argument = frequency * t + drivers.phase[d]", "argument = frequency * t", BY_HAND),
    Defect(
        P, "acceleration = acceleration * t + 2.0 * rate", "acceleration = acceleration * t + rate", BY_HAND
    ),
    Defect(P, "rate += amplitude * frequency * cos(argument)", "rate += amplitude * cos(argument)", BY_HAND),
    Defect(
        P,
        "acceleration -= amplitude * frequency * frequency * sin(argument)",
        "acceleration += amplitude * frequency * frequency * sin(argument)",
        BY_HAND,
    ),
    Defect(
        P,
        "return direction, scale(-rate, along), second",
        "return direction, scale(rate, along), second",
        BY_HAND,
    ),
    Defect(
        P,
        "second = subtract(scale(-acceleration, along), scale(rate * rate, direction))",
        "second = add(scale(-acceleration, along), scale(rate * rate, direction))",
        f"{PRIMITIVES}::test_gamma_and_rate_of_velocity_equations",
    ),
    Defect(
        P,
        "+ 2.0 * dot(to_world(rotation, i, turn_i), to_world(rotation, j, turn_j))",
        "+ dot(to_world(rotation, i, turn_i), to_world(rotation, j, turn_j))",
        f"{PRIMITIVES}::test_gamma_and_rate_of_velocity_equations",
    ),
    Defect(
        P,
        "put(blocks, row + k, column, scale(sign, cross(s, along)))",
        "put(blocks, row + k, column, scale(-sign, cross(s, along)))",
        f"{PRIMITIVES}::test_jacobian_and_difference_of_phi",
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
        BY_HAND,
    ),
    Defect(
        L, "+ loads.damping[k] * rate\n        force", "- loads.damping[k] * rate\n        force", BY_HAND
    ),
    Defect(L, "push(j, s_j, scale(-1.0, force), frames, g)", "push(j, s_j, force, frames, g)", BY_HAND),
    Defect(
        L,
        "loads.stiffness[k] * (angle - loads.natural[k])",
        "loads.stiffness[k] * (angle + loads.natural[k])",
        BY_HAND,
    ),
    Defect(L, "rate = dot(subtract(w_j, w_i), axis)", "rate = dot(subtract(w_i, w_j), axis)", BY_HAND),
    Defect(
        L,
        "accumulate(g, 6 * i + 3, to_body(rotation, i, scale(-1.0, moment)))",
        "accumulate(g, 6 * i + 3, to_body(rotation, i, moment))",
        BY_HAND,
    ),
    Defect(
        L,
        "accumulate(g, 6 * body + 3, to_body(frames.rotation, body, vector(loads.force, k)))",
        "accumulate(g, 6 * body + 3, vector(loads.force, k))",
        BY_HAND,
    ),
    Defect(
        "mbref/stabilisation/baumgarte.py",
        'return 2 * options["alpha"], options["beta"] ** 2',
        'return 2 * options["beta"], options["alpha"] ** 2',
        BY_HAND,
    ),
    Defect(
        "mbref/equations/joint_reactions.py",
        "np.where(side == 1, -1.0, 1.0)",
        "np.where(side == 1, -1.0, -1.0)",
        BY_HAND,
    ),
    Defect(
        "mbref/equations/joint_reactions.py",
        "- rotations.cross(arm, force)",
        "+ rotations.cross(arm, force)",
        BY_HAND,
    ),
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
    Defect(V, "amplitude * math.sin(phase)\n    return", "amplitude * math.cos(phase)\n    return", BY_HAND),
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
    Defect(R, "os.truncate(path, whole)", "os.truncate(path, 0)", RECORDS),
    Defect(R, "if text and len(foreign) == len(lines):", "if False:", RECORDS),
    Defect(R, "file.truncate(before)", "pass", RECORDS),
    Defect(R, "enumerate(lines, 1)", "enumerate(lines)", RECORDS),
    Defect(R, "parse_constant=_refused", "parse_constant=float", RECORDS),
    Defect(
        "mbref/kernels/checked_file.py", "if hashlib.sha256(data).digest() == digest:", "if data:", CACHES
    ),
    Defect("mbref/kernels/checked_file.py", "os.replace(temporary, path)", "path.write_bytes(data)", CACHES),
    # the Taylor method
    Defect(
        TL,
        "springs.damping[s] * product(of[RATE], of[INVERSE], k)",
        "springs.damping[s] * product(of[RATE], of[LENGTH], k)",
        CLOSED_FORMS,
    ),
    Defect(
        TL,
        "i * (of[COS, k - i] * of[SIN, i] - of[SIN, k - i] * of[COS, i])",
        "i * (of[COS, k - i] * of[SIN, i] + of[SIN, k - i] * of[COS, i])",
        CLOSED_FORMS,
    ),
    Defect(
        TS,
        "factor = (1.0 if side >= 0.0 else -1.0) / sqrt(square)",
        "factor = 1.0 / sqrt(square)",
        CLOSED_FORMS,
    ),
    Defect(TS, "x, y, z = a[7] - a[5],", "x, y, z = a[5] - a[7],", CLOSED_FORMS),
    Defect(
        TS,
        "beside = is_exact and watch.smallest_pivot < BESIDE * watch.reference_pivot",
        "beside = False",
        CLOSED_FORMS,
    ),
    Defect(
        TS,
        "        if passing:",
        "        if False:",
        "tests/mbref/test_singular_crossing.py::test_accelerations_and_reactions_beside_a_crossing",
    ),
    Defect(
        "mbref/taylor/crossing/determinants.py",
        "(along < 0.0) != (partition.parity != memory.step.start_parity)",
        "along < 0.0",
        "tests/mbref/test_determinants.py",
    ),
    Defect(
        "mbref/taylor/crossing/detection.py",
        " if square else gradient_determinant(memory.series.terms, memory)",
        "",
        f"{CROSSINGS}::test_no_loose_series_hops_over_a_gap",
    ),
    Defect("mbref/taylor/generated/power_orders.py", "        if is_second:", "        if False:", BY_POWER),
    Defect(
        "mbref/taylor/generated/power_orders.py",
        "known += self._power_of_moments(self._velocity_moments, k)",
        "pass",
        BY_POWER,
    ),
    Defect(
        "mbref/taylor/series.py",
        "return not memory.step.deceleration * h <= SLOWEST",
        "return False",
        "tests/mbref/test_generated_code.py",
    ),
    Defect(
        "mbref/taylor/series.py",
        "share = 0.5 if k == 0 else 1.0",
        "share = 1.0",
        f"{CLOSED_FORMS}::test_a_closed_form[free_fall]",
    ),
    Defect(
        "mbref/taylor/stepping.py",
        "log(tolerance / size) / k",
        "log(tolerance / size) / (k + 1)",
        CLOSED_FORMS,
    ),
    Defect(
        "mbref/taylor/pose_maps.py",
        "c * x_rate - s * y_rate - speed * turned",
        "c * x_rate - s * y_rate + speed * turned",
        CLOSED_FORMS,
        "the rate is a first guess, which the correction of velocities makes exact: any number will do",
    ),
    # ensembles and the command line
    Defect(
        "mbref/ensembles/ensemble.py",
        "identity = [scene.to_dict(), times.tolist(), str(method)",
        "identity = [scene.to_dict(), str(method)",
        f"{ENSEMBLE}::test_other_limits_and_stored_results_are_not_confused",
    ),
    Defect(
        "mbref/ensembles/ensemble.py",
        "            if key in known:",
        "            if False:",
        f"{ENSEMBLE}::test_interrupted_and_uninterrupted_ensembles_agree",
    ),
    Defect(
        "mbref/cli/ensemble.py",
        "values.std(axis=0)",
        "values.std(axis=0, ddof=1)",
        f"{ENSEMBLE}::test_command_and_single_runs_agree",
    ),
    Defect(
        "mbref/cli/run.py",
        "{cost.steps} steps, {cost.rejected} rejected, {cost.rhs} evaluations",
        "{cost.steps} steps, {cost.rhs} rejected, {cost.rejected} evaluations",
        BY_HAND,
    ),
    Defect(
        "mbref/linear_algebra/elimination.py",
        "        if a[k, k] < 0.0:",
        "        if a[k, k] > 0.0:",
        BY_HAND,
    ),
    Defect(
        "mbref/taylor/crossing/acceptance.py",
        "    if is_deep or not step.violation <= largest_violation(memory)",
        "    if is_deep or not step.violation <= 1e9 * largest_violation(memory)",
        f"{CROSSINGS}::test_a_motion_that_passes_beside_the_flat_position_has_right_samples",
    ),
    Defect(
        "mbref/taylor/crossing/detection.py",
        "    if changes_signs(memory) and vanishes_inside(h, memory):",
        "    if False:",
        "tests/mbref/test_pairs_of_crossings.py",
    ),
    Defect(
        "mbref/taylor/crossing/location.py",
        "return (change, -1.0) if change >= 0.0 else find_pair(h, memory)",
        "return change, -1.0",
        "tests/mbref/test_pairs_of_crossings.py",
    ),
    Defect(
        "mbref/taylor/crossing/acceptance.py",
        "    if is_shallow or not step.violation",
        "    if not step.violation",
        THRESHOLDS,
    ),
    Defect(
        "mbref/taylor/crossing/rounding_pole.py",
        "return distance if is_rounding else 0.0",
        "return distance",
        f"{THRESHOLDS} tests/mbref/test_rounding_pole.py",
    ),
    Defect(
        "mbref/taylor/crossing/uniqueness.py",
        "    return places <= near and rates",
        "    return rates",
        THRESHOLDS,
    ),
    Defect(
        "mbref/taylor/crossing/short_crossing.py",
        "    return freedoms(memory) <= is_undriven(memory)",
        "    return freedoms(memory) <= 2",
        SHORT,
    ),
    Defect(
        "mbref/taylor/crossing/uniqueness.py",
        "    return least > 0.0 and least >= MIN_ENERGY * first and not reverses",
        "    return True",
        SHORT,
    ),
    Defect(
        "mbref/simulation/singular_crossing.py",
        "    return is_near(memory) and memory.watch.smallest_pivot < memory.watch.past_pivot",
        "    return False",
        f"{CROSSINGS}::test_a_driven_loop_crosses_from_any_angle",
    ),
)
