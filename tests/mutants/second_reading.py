"""One-line defects of a second reading: judge, studies, adapters, variants, energies and sections."""

from __future__ import annotations

from tests.mutants.defect import Defect

MOTIONS, VERDICT = (f"tests/crosscheck/test_{name}.py" for name in ("exact_motions", "verdict"))
ENSEMBLE, LIMITS = (
    "tests/mbref/test_ensemble.py",
    "tests/reports/test_sections.py::test_limits_and_the_bias_put_in",
)
DRAWN = f"{ENSEMBLE}::test_drawn_numbers_and_their_distributions_agree"
REFUSED = f"{ENSEMBLE}::test_command_refuses_what_cannot_vary"
MOMENTUM, VARIATION = "crosscheck/judge/momentum.py", "mbref/variation.py"
CONVERGENCE = "reports/sections/convergence.py"

DEFECTS = (
    Defect(
        MOMENTUM, " - time * _turning_push(scene)", "", f"{MOTIONS}::test_moment_of_momentum_and_a_moment"
    ),
    Defect(MOMENTUM, "np.maximum(*drifts)", "np.minimum(*drifts)", MOTIONS),
    Defect(VARIATION, "np.random.default_rng([seed, k])", "np.random.default_rng(seed)", DRAWN),
    Defect(VARIATION, "(high >= 0 if normal else high >= low)", "high >= 0", REFUSED),
    Defect(
        "mbref/energy.py",
        "- load.natural_angle",
        "+ load.natural_angle",
        "tests/mbref/test_motion.py::test_energy_is_kept_by_springs_and_torsion_springs",
    ),
    Defect(
        "crosscheck/study/ladder.py",
        "return known * was / will_be",
        "return known * will_be / was",
        "tests/reports/test_render.py::test_the_cost_of_a_step_is_inverse_to_its_length",
    ),
    Defect(
        "crosscheck/study/tuning.py",
        "limit = min((",
        "limit = max((",
        f"{VERDICT}::test_a_family_dearer_than_the_cheapest_that_reached_is_given_up",
    ),
    Defect(
        "crosscheck/engines/pinocchio/model.py",
        "+ load.damping * v[iv]",
        "- load.damping * v[iv]",
        "tests/crosscheck/test_tree_engines.py",
    ),
    Defect(CONVERGENCE, "finest = min(told", "finest = max(told", LIMITS),
    Defect(CONVERGENCE, 'return "bias"', 'return "discretisation"', LIMITS),
)
