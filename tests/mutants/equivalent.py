"""Mutants that change nothing that a program could observe, each with the reason."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection

from tests.mutants.operators import Mutant

ERRORS = "position_error_series(scene, trajectory, exact), rotation_error_series(scene, trajectory, exact)"
AT_FIRST_CALL = (
    "Kernels that are not prepared are compiled or loaded at their first call, with equal results."
)
WITHOUT_SAMPLES = "for system in (dop853.System(0, 0, places,"
NO_STEP = "A run without samples takes no step; its numbers only give the types for which code is compiled."
"""The line that compiles integrators for such runs, and the reason."""
STANDING_IN = "GENERAL = ((1.0, 1.1, 1.2),", "UNIT = (1.0, 0.0, 0.0, 0.0)"
WRITTEN_LATER = "The true masses and axes are written after compilation; a body without inertia has no axes."
"""Lines of MuJoCo's model with numbers that are replaced later, and the reason."""
COMMUTATIVE = {
    *("add", "product_order", "write.product", "self._write.product"),
    *(f"self._builder.{name}" for name in ("add", "and_", "fadd", "fmul", "mul")),
}
COMMUTES = "A sum or a product is the same for its two parts in any order."
"""Functions of mbref whose first two arguments may be exchanged, and the reason."""
EXCHANGES = {"exchange_rows", "exchange_columns", "exchange_entries"}
EXCHANGED = "Two rows or columns are exchanged, whichever is named first."
"""Functions of mbref whose third and fourth arguments may be exchanged, and the reason."""
SYMMETRIC = {
    0: {
        "np.add",
        "np.union1d",
        "_is",
        "suppress",
        "contextlib.suppress",
        "convolved",
        "_dot",
        "rotations.angle_between",
        "distances",
        "combination",
        "self._inner_product",
        "self._combined",
        "self._plus",
        "self._sum",
        "_angle",
    },
    1: {"np.swapaxes", "difference", "error_series", "rod"},
}
SYMMETRY = "The result is the same for these two arguments in any order."
"""Functions that treat two successive arguments alike, by the number of the first one, and the reason."""
UNKNOWN_LENGTH = "NumPy finds the length of any dimension with a negative length."
ALIKE = "The comparison treats both arrays alike."
ZERO_TIMES = "Zero times any vector is a vector of zeros."
SKIPS_ZERO = "A row is left as it is when zero times another row is subtracted."
PADDED = "Sizes of one and of two are both padded to eight lanes."
ZERO_ALREADY = "Memory is zero at first, and no kernel writes another number there."
ANY_RANDOM = "Any random numbers serve; the seed only makes results repeatable."
PATTERN = "The order of elimination and the fill depend on the pattern of the matrix alone."
FOR_TYPES = "Type checkers alone read a type variable."
UNUSED_LANE = "A lane whose weight is zero may hold any number."
NUMBERS = (
    (r"reshape\([^()]*-$", "1", "2", UNKNOWN_LENGTH),
    (r"\b0\.0 \* load\([\w.]+, $", "0", "1", ZERO_TIMES),
    (r"np\.where\(weights?, .*, $", "-1", "(+1)", UNUSED_LANE),
    (r"np\.where\(weights?, .*, -$", "1", "2", UNUSED_LANE),
)
"""The text before a number, the number, another one that changes nothing, and the reason."""
SAMPLE = "(np.random.default_rng(1).uniform(0.5, 1.0, d.nnz), d.indices, d.indptr), shape=d.shape"
DOMINANT = 's = s + eye_array(size, format="csc") * (10.0 * abs(s).sum(axis=0).max())'
OPTIONS = (
    's, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}'
)
ALL_ALIKE = "All entries of an inertia are numbers, or all are rows of a matrix."
COLLECTOR = "The garbage collector only takes time during imports; nothing is collected otherwise."
REASONS: dict[tuple[str, str, str], str] = {
    (
        "crosscheck/conformance/relations.py",
        "return np.eye(3) if np.linalg.det(self.matrix) > 0 else FLIP",
        "(np.linalg.det(self.matrix) >= 0)",
    ): "The matrix is orthogonal, so that its determinant is 1 or -1.",
    (
        "crosscheck/conformance/awkward_parts.py",
        "way = np.subtract(stop, start)",
        "np.subtract(start, stop)",
    ): "A rod has the same length and inertia in both directions.",
    (
        "crosscheck/judge/precision.py",
        '"orientations": np.where(is_turned, -run.orientation, run.orientation),',
        "np.where(is_turned, run.orientation, -run.orientation)",
    ): "A series and its negative have the same noise.",
    **{
        (
            "crosscheck/judge/start.py",
            "return float(np.abs(gap + second[:, None] - coupling.ratio * first).min())",
            new,
        ): "Turns of either sign are tried."
        for new in ("((gap) - (second[:, None]))", "((gap + second[:, None]) + (coupling.ratio * first))")
    },
    (
        "crosscheck/judge/richardson.py",
        "return float(brentq(off, LEAST_ORDER, HIGHEST_ORDER))",
        "brentq(off, HIGHEST_ORDER, LEAST_ORDER)",
    ): "The bracket of a root has no direction.",
    (
        "crosscheck/judge/reference/certify.py",
        "bound = SAFETY * float(differences(scene, a, b).max(initial=0.0))",
        "differences(scene, b, a)",
    ): "The difference of two motions is the same in both directions.",
    (
        "mbref/taylor/orientations.py",
        "across = [rotations.cross(self.basis[k - 2], self.basis[k - 1]) for k in range(3)]",
        "rotations.cross(self.basis[k - 1], self.basis[k - 2])",
    ): "The products and the determinant by which they are divided change their signs together.",
    ("mbref/linear_algebra/elimination.py", "first = 0.0", "1.0"): "The first pivot replaces the number.",
    (
        "crosscheck/engines/sdf/reading.py",
        "return np.array([[entry(i, j) for j in range(3)] for i in range(3)])",
        "entry(j, i)",
    ): "The function puts its two numbers in order.",
    (
        "mbref/joint_motion.py",
        'rate = np.einsum("ki,ki->k", speeds[1] - speeds[0], axis) + np.einsum("ki,ki->k", apart, turning)',
        "np.einsum('ki,ki->k', turning, apart)",
    ): SYMMETRY,
    (
        "mbref/joint_motion.py",
        'rate = np.einsum("ki,ki->k", speeds[1] - speeds[0], axis) + np.einsum("ki,ki->k", apart, turning)',
        "np.einsum('ki,ki->k', axis, speeds[1] - speeds[0])",
    ): SYMMETRY,
    (
        "mbref/taylor/natural.py",
        "moved = (combination((1.0, c), (1.0, a)) for c, a in zip(centre, arm, strict=True))",
        "zip(arm, centre, strict=True)",
    ): COMMUTES,
    (
        "mbref/taylor/natural.py",
        "pairs = [*zip(apart, apart, strict=True), ({ONE: length}, {ONE: -length})]",
        "({ONE: -length}, {ONE: length})",
    ): COMMUTES,
    **{
        (f"mbref/taylor/generated/{file}.py", line, new): COMMUTES
        for file, line, new in (
            (
                "power_orders",
                "return self._put(k, turned, power, self._inverse_of_growth(k))",
                "self._put(k, turned, self._inverse_of_growth(k), power)",
            ),
            (
                "power_orders",
                "row = self._put(WHOLE(0), self._scaled(HALF, self._turned(velocity)), power, HALF)",
                "self._put(WHOLE(0), self._scaled(HALF, self._turned(velocity)), HALF, power)",
            ),
            (
                "power_orders",
                "return [self._write.total(pair) for pair in zip(one, other, strict=True)]",
                "zip(other, one, strict=True)",
            ),
            (
                "power_orders",
                "row = [write.total(pair) for pair in zip(row, moved, strict=True)]",
                "zip(moved, row, strict=True)",
            ),
            (
                "power_orders",
                "lost = (write.minus(write.product(n, z)) for n, z in zip(newest, row, strict=True))",
                "zip(row, newest, strict=True)",
            ),
            (
                "power_orders",
                "return [self._write.product(one, other) "
                "for one, other in zip(along, self._row(k), strict=True)]",
                "zip(self._row(k), along, strict=True)",
            ),
            (
                "elimination",
                "reduced = [[self._inner(momenta[f], motions[g]) for g in free] for f in free]",
                "self._inner(motions[g], momenta[f])",
            ),
        )
    },
    **{
        ("mbref/taylor/load_polynomials.py", line, "4"): "A product of vectors has three components."
        for line in (
            "form = moving[..., k : k + 3, :]",
            "turned = rotations.cross(moment, at_rest[..., k : k + 3])",
        )
    },
    (
        "mbref/taylor/orientations.py",
        "pairs = [*zip(direction_vectors[i], direction_vectors[j], strict=True), (square, {ONE: 1.0})]",
        "zip(direction_vectors[j], direction_vectors[i], strict=True)",
    ): COMMUTES,
    (
        "mbref/taylor/generated/power_orders.py",
        "return self._write.total(list(map(self._write.product, factors, vectors)))",
        "map(self._write.product, vectors, factors)",
    ): COMMUTES,
    (
        "crosscheck/study/ladder.py",
        "return [] if setting is None else [family[0]._replace(setting=setting)]",
        "1",
    ): "The cases of a family differ in their settings alone.",
    (
        "mbref/equations/parts.py",
        "tuple((body.name, body.inertia and isinstance(body.inertia[0], tuple)) for body in scene.body),",
        "1",
    ): ALL_ALIKE,
    ("mbref/equations/packing.py", "if not isinstance(inertia[0], tuple):", "1"): ALL_ALIKE,
    (
        "crosscheck/engines/spanning_tree.py",
        "DRIVEN_WEIGHT = 10  # exceeds the number of rows of any joint, so that driven joints are cut last",
        "11",
    ): "A joint has at most six rows; every larger weight gives the same tree.",
    (
        "mbref/scenes/planar_slider_crank.py",
        "along, across, _ = rod_inertia(DENSITY * length, length)",
        "rod_inertia(length, DENSITY * length)",
    ): "A metre of rod has 1 kg, so that the mass of a rod is its length.",
    (
        "crosscheck/judge/gauss_principle.py",
        "mass[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = (body.mass or 0.0) * np.eye(3)",
        "(body.mass)",
    ): "The function needs the masses of all bodies before; the number is for types.",
    (
        "crosscheck/cli/__init__.py",
        "gc.disable()  # garbage collection would only cost time during the imports",
        "pass",
    ): COLLECTOR,
    ("crosscheck/cli/__init__.py", "gc.freeze()", "pass"): COLLECTOR,
    ("crosscheck/processes/fork_server.py", "gc.freeze()", "pass"): COLLECTOR,
    ("crosscheck/judge/metrics.py", ERRORS, "position_error_series(scene, exact, trajectory)"): (
        "The distance of two points is the same in both directions."
    ),
    ("crosscheck/judge/metrics.py", ERRORS, "rotation_error_series(scene, exact, trajectory)"): (
        "The angle between two orientations is the same in both directions."
    ),
    (
        "crosscheck/judge/truth/one_dof.py",
        "reached = self._solution.reach(lambda y: y[2] >= times.max(initial=0) or y[0] >= TURN)",
        "(y[0] > TURN)",
    ): "One panel more is integrated where a panel ends at a full turn; the motion is the same.",
    (
        "crosscheck/engines/mujoco/importing/agreement.py",
        'self._same(twists.T @ forces, data.qfrc_bias - data.qfrc_passive, "bias forces", largest)',
        "self._same(data.qfrc_bias - data.qfrc_passive, twists.T @ forces, 'bias forces', largest)",
    ): ALIKE,
    (
        "crosscheck/engines/mujoco/importing/agreement.py",
        'self._same(ours, self.poses.mass(), "mass matrix")',
        "self._same(self.poses.mass(), ours, 'mass matrix')",
    ): ALIKE,
    (
        "crosscheck/judge/reference/natural_joints.py",
        "on_axis, on_apart = (convolved(force[:, None], v, k) for v in (self._apart, self._axis))",
        "convolved(v, force[:, None], k)",
    ): "The product of two series is the same in both orders.",
    (
        "crosscheck/judge/truth/crankshaft.py",
        'return Path("crankshaft", poses, paths[0].axis, turning_driver(scene, paths[0].axis, turns))',
        "1",
    ): "All cranks of a crankshaft turn about one axis, since `one_dof` refuses every other path.",
    (
        "mbref/equations/joint_reactions.py",
        "if not place.part or place.of not in names:",
        "(place.of not in names)",
    ): "A primitive that is no part of a coupling or an armature names no joint in its field ``of``.",
    ("mbref/records.py", "text = json.dumps(_finite(value), allow_nan=False)", "True"): (
        "No number is infinite or NaN there any more."
    ),
    ("mbref/simulation/start_run.py", "if method.is_series:", "(not (method.is_series))"): AT_FIRST_CALL,
    ("mbref/stepping/preparation.py", "prepare_all(kernels_of(method))", "pass"): AT_FIRST_CALL,
    ("mbref/taylor/preparation.py", "prepare_all(KERNELS_OF_SERIES)", "pass"): AT_FIRST_CALL,
    ("mbref/taylor/preparation.py", "prepare_all(KERNELS_OF_SERIES[::-1])", "pass"): AT_FIRST_CALL,
    ("mbref/taylor/preparation.py", "prepare_all(KERNELS_OF_SERIES[::-1])", "(+1)"): AT_FIRST_CALL,
    ("mbref/taylor/polynomials.py", "slots, start = _slots(terms, (0, 0, 0.0))", "1"): (
        "A padded slot has the weight zero, whatever its factors are."
    ),
    (
        "mbref/taylor/crossing/location.py",
        "if value_at(middle, unit, memory) < 0.0:",
        "(value_at(middle, unit, memory) <= 0.0)",
    ): "A value of zero is the sign change; bisection comes to it from either side.",
    ("mbref/equations/primitives.py", "put(blocks, row, 0, NOTHING)", "pass"): ZERO_ALREADY,
    ("mbref/equations/primitives.py", "put(blocks, row, 0, NOTHING)", "1"): ZERO_ALREADY,
    ("mbref/equations/primitives.py", "put(blocks, row, 6, NOTHING)", "pass"): ZERO_ALREADY,
    ("mbref/equations/primitives.py", "put(blocks, row, 6, NOTHING)", "7"): ZERO_ALREADY,
    **{
        ("mbref/linear_algebra/symbolic_factorisation.py", SAMPLE, new): PATTERN
        for new in ("2", "1.0", "2.0")
    },
    **{
        ("mbref/linear_algebra/symbolic_factorisation.py", DOMINANT, new): PATTERN
        for new in (
            "20.0",
            "1",
            "abs(s).sum(axis=0).min",
            "((10.0) / (abs(s).sum(axis=0).max()))",
            "((eye_array(size, format='csc')) / (10.0 * abs(s).sum(axis=0).max()))",
            "((s) - (eye_array(size, format='csc') * (10.0 * abs(s).sum(axis=0).max())))",
        )
    },
    **{("mbref/linear_algebra/symbolic_factorisation.py", OPTIONS, new): PATTERN for new in ("1.0", "True")},
    (
        "mbref/equations/active_coordinates.py",
        "found = np.append(columns, np.zeros(6, dtype=bool))",
        "7",
    ): "The fixed frame has six columns; no entry has a seventh.",
    (
        "mbref/equations/branches.py",
        "return right[sizes > ZERO_FORM * max(1.0, sizes.max(initial=0.0))].reshape(-1, d, d)",
        "1.0",
    ): "The largest size counts as one at least.",
    (
        "mbref/equations/functions.py",
        "if functions.amplitude[f] == 0.0 or functions.part[p] == 0.0:",
        "(functions.part[p] == 0.0)",
    ): "A sine without amplitude adds zeros.",
    ("mbref/equations/active_coordinates.py", "rng = np.random.default_rng(1)", "2"): ANY_RANDOM,
    (
        "mbref/equations/branches.py",
        "(_, d, _), random = forms.shape, np.random.default_rng(0)",
        "1",
    ): ANY_RANDOM,
    (
        "mbref/linear_algebra/redundancy.py",
        "start = np.random.default_rng(1).normal(size=m)",
        "2",
    ): ANY_RANDOM,
    (
        "mbref/equations/joint_reactions.py",
        "components = slice(3, 6) if turns else slice(0, 3)",
        "7",
    ): "A wrench has six components, of which a slice takes the last three.",
    (
        "mbref/linear_algebra/minimum_norm.py",
        "direction[:], before = 0.0, 1.0",
        "2.0",
    ): "The first direction has no direction before it, whose part is zero.",
    ("mbref/stabilisation/partitioning.py", "for k in range(3):", "4"): (
        "The fourth entry is overwritten afterwards."
    ),
    (
        "mbref/scenes/flyball_governor.py",
        "velocity = (-SPIN * position[1], SPIN * position[0], 0.0)",
        "(+SPIN)",
    ): "All parts have the coordinate y = 0.",
    ("mbref/scenes/flyball_governor.py", "mass = DENSITY * LENGTH * SIDE**2", "((DENSITY) / (LENGTH))"): (
        "The rods are 1 m long."
    ),
    (
        "mbref/scenes/flyball_governor.py",
        "reach = (rod * LENGTH / 2 + BALL * LENGTH) / mass",
        "((BALL) / (LENGTH))",
    ): "The rods are 1 m long.",
    (
        "mbref/scenes/flyball_governor.py",
        "reach = (rod * LENGTH / 2 + BALL * LENGTH) / mass",
        "((rod) / (LENGTH))",
    ): "The rods are 1 m long.",
    (
        "mbref/taylor/generated/elimination.py",
        "write.put(write.minus(entry), self._null_space, f * self._lanes, column)",
        "write.put(write.minus(entry), self._null_space, column, f * self._lanes)",
    ): "The place in memory is the sum of both numbers.",
    (
        "mbref/design/turning.py",
        "return Turning(sign * driver.polynomial[1] * axis, np.array(joint.anchor_pair[0]), driver.joint)",
        "1",
    ): "Both bodies of a joint that turns have one anchor.",
    (
        "mbref/taylor/generated/instructions.py",
        'argument.add_attribute("noalias")',
        "pass",
    ): "The arrays do not overlap; the attribute permits the compiler to make faster code.",
    (
        "mbref/taylor/polynomials.py",
        "self._lanes = padded_size(max(1, len(lane) + len(of.rows)))",
        "2",
    ): PADDED,
    (
        "mbref/taylor/series_memory.py",
        '"lanes": padded_size(max(1, nz + nr + ng)), "slots": polynomials.products.left.size,',
        "2",
    ): PADDED,
    ("mbref/taylor/solver.py", "if i != r and entry != 0.0:", "(i != r)"): SKIPS_ZERO,
    ("mbref/taylor/solver.py", "if g != f and entry != 0.0:", "(g != f)"): SKIPS_ZERO,
    **{
        (file, line, new): "Each factor is 1 or -1."
        for file, line, new in (
            (
                "mbref/rotations.py",
                "return np.asarray(p, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])",
                "((np.asarray(p, dtype=float)) / (np.array([1.0, -1.0, -1.0, -1.0])))",
            ),
            (
                "mbref/drawing/marks.py",
                "sign = _turning(stage, axis * sense, 15.0)",
                "((axis) / (sense))",
            ),
            (
                "mbref/drawing/marks.py",
                "sign = _arrow_from_origin(stage, axis * sense)",
                "((axis) / (sense))",
            ),
            (
                "mbref/drawing/marks.py",
                "sense = axis * np.copysign(1.0, load.action.amount)",
                "((axis) / (np.copysign(1.0, load.action.amount)))",
            ),
        )
    },
    **{
        (f"mbref/scenes/{file}.py", line, new): "A rod's mass in kg and its length in m are equal."
        for file, line, new in (
            ("bennett", "inertia=rod_inertia(mass, length),", "rod_inertia(length, mass)"),
            ("links", "inertia=rod_inertia(mass, length),", "rod_inertia(length, mass)"),
            (
                "sarrus",
                "name=name, mass=MASS, inertia=rod_inertia(MASS, LENGTH), position=middle, "
                "orientation=orientation",
                "rod_inertia(LENGTH, MASS)",
            ),
            (
                "planar_slider_crank",
                "along, across, _ = rod_inertia(DENSITY * length, length)",
                "rod_inertia(length, DENSITY * length)",
            ),
        )
    },
    (
        "mbref/scenes/andrews_squeezer.py",
        "ANGLES = (BETA, BETA + THETA, GAMMA, PHI + DELTA, DELTA, OMEGA + EPSILON, EPSILON)  # rad, at t = 0",
        "((BETA) - (THETA))",
    ): "The published angle is zero.",
    (
        "mbref/scenes/bricard.py",
        "inertia = triple(about if p != q else across for p, q in zip(start, end, strict=True))",
        "zip(end, start, strict=True)",
    ): SYMMETRY,
    (
        "mbref/scenes/links.py",
        "return triple((p + q) / 2 for p, q in zip(start, end, strict=True))",
        "zip(end, start, strict=True)",
    ): SYMMETRY,
    (
        "mbref/design/equilibrium.py",
        "if settled is not None and not any(_is_same(settled, other) for other in found):",
        "_is_same(other, settled)",
    ): SYMMETRY,
    (
        "mbref/design/equilibrium.py",
        "apart = displacement(first.q, second.q) / first.units",
        "displacement(second.q, first.q)",
    ): "The displacements in both directions are opposite, about equal axes of the bodies.",
    (
        "reports/mechanisms.py",
        "samples = np.unique(np.linspace(0, len(motion.times) - 1, number).astype(int))",
        "np.linspace(len(motion.times) - 1, 0, number)",
    ): "The samples are sorted afterwards.",
    (
        "reports/sections/paper_sweep.py",
        "paper = sorted({cell.end for cell in cells if cell.end is not None})",
        "True",
    ): "Each cell of SWEPT has a letter, and a cell with a letter has an end; the check is for types.",
}
"""By file, the line of the source and the new text of the mutant."""


def reason(mutant: Mutant, source: str) -> str:
    """Return why a mutant of a source changes nothing; empty where it does."""
    if mutant.file.startswith("mbref/") and mutant.kind == "argument order":
        if exchanges_parts(mutant):
            return COMMUTES
        if exchanges_parts(mutant, EXCHANGES, 2):
            return EXCHANGED
    if mutant.kind == "argument order" and (
        re.search(r"\.swapaxes\([-12]+, [-12]+\)$", mutant.old)
        or any(exchanges_parts(mutant, names, first) for first, names in SYMMETRIC.items())
    ):
        return SYMMETRY
    before = source.encode()[: mutant.start].decode()
    for pattern, old, new, why in NUMBERS:
        if (mutant.old, mutant.new) == (old, new) and re.search(pattern, before):
            return why
    if mutant.kind == "argument order":
        if re.search(r"\bproduct_sum\((\[\*)?$", before) and exchanges_parts(mutant, {"zip"}):
            return COMMUTES
        if re.search(r"\bnorm\($", before) and exchanges_parts(mutant, {"rotations.cross"}):
            return SYMMETRY
    line = source.splitlines()[mutant.line - 1].strip()
    if " = TypeVar(" in line:
        return FOR_TYPES
    if mutant.file == "crosscheck/engines/compiled/run.py" and line.startswith(WITHOUT_SAMPLES):
        return NO_STEP
    if mutant.file == "crosscheck/engines/mujoco/model.py" and line.startswith(STANDING_IN):
        return WRITTEN_LATER
    return REASONS.get((mutant.file, line, mutant.new), "")


def exchanges_parts(mutant: Mutant, functions: Collection[str] = COMMUTATIVE, first: int = 0) -> bool:
    """Return whether a mutant exchanges an argument, and the next, of one of these functions."""
    old, new = (ast.parse(text, mode="eval").body for text in (mutant.old, mutant.new))
    assert isinstance(old, ast.Call) and isinstance(new, ast.Call)
    before, after = (list(map(ast.unparse, call.args[first : first + 2])) for call in (old, new))
    return ast.unparse(old.func) in functions and before == after[::-1]
