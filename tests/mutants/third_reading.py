"""One-line defects of a third reading, in parts that no table had: optional engines, mbref's door, exchange.

Of its 36 defects the tests killed 24 when they were planted first.  These are the twelve that survived, and
others of engines and files that nothing else in the tables reaches.
"""

from __future__ import annotations

from tests.mutants.defect import Defect

E = "crosscheck/engines"
C, M, R = "tests/crosscheck/test_", "tests/mbref/test_", "tests/reports/test_"
SIMBODY, SUNDIALS, ONDSEL = (f"{C}{name}.py" for name in ("simbody", "sundials", "ondsel"))
MOTION, HELP, VERDICT = f"{M}motion.py", f"{M}scene_help.py", f"{C}verdict.py"
REFERENCE, EXCHANGE = f"{C}reference.py", f"{C}exchange.py"
ALIKE = f"{SIMBODY}::test_simbody_and_pinocchio_move_alike"

DEFECTS = (
    # survivors, each with the test that was written for it
    Defect(
        f"{E}/ondsel/model.py",
        "{t} + ({s.phase!r}))",
        "{t})",
        f"{ONDSEL}::test_a_driver_with_a_phase_and_the_angle_it_prescribes",
    ),
    Defect(
        f"{E}/generalised_forces.py",
        "return angle + 2 * np.pi * np.round((estimate - angle) / (2 * np.pi))",
        "return angle",
        f"{SUNDIALS}::test_torsion_spring_beyond_a_turn_and_closed_form_agree",
    ),
    Defect(
        "mbref/joint_motion.py",
        "start = -2 * np.pi * np.round(wrapped[:1] / (2 * np.pi))",
        "start = 0.0 * wrapped[:1]",
        f"{MOTION}::test_angle_of_a_joint_is_the_same_where_a_quaternion_has_the_other_sign",
    ),
    Defect(
        "mbref/energy.py",
        "own = rotations.rotate(turned_back, motion.angular_velocity)",
        "own = motion.angular_velocity",
        f"{MOTION}::test_energy_of_a_tumbling_body_is_that_of_its_principal_axes",
    ),
    Defect(
        "mbref/motion.py",
        '(("orientation", "wxyz")',
        '(("orientation", "xyzw")',
        f"{MOTION}::test_csv_and_frame_have_the_columns",
    ),
    Defect(
        "mbref/drawing/plot.py",
        '"rate": "rad/s"',
        '"rate": "rad"',
        f"{MOTION}::test_panels_of_a_plot_have_the_units_of_their_quantities",
    ),
    Defect("mbref/scene_validation.py", "abs(start) > 1e-12", "abs(start) > 1e-2", f"{M}scene.py"),
    Defect(
        "mbref/scene_slips.py",
        "abs(sine.phase) > TURN",
        "sine.phase > TURN",
        f"{HELP}::test_angles_beyond_a_turn_are_probably_degrees",
    ),
    Defect(
        "crosscheck/judge/reference/reference.py",
        "missing.min() > self.until() and self.seconds >= seconds",
        "missing.min() > self.until() and self.seconds <= seconds",
        f"{REFERENCE}::test_a_motion_that_ended_is_computed_again_only_in_more_time",
    ),
    Defect(
        "crosscheck/study/verdict.py",
        "if np.array_equal(motions[a].times, motions[b].times)",
        "if not np.array_equal(motions[a].times, motions[b].times)",
        VERDICT,
    ),
    Defect(
        "reports/engine_looks.py",
        "return min(names.index(engine), TONES - 1) if",
        "return names.index(engine) % 3 if",
        f"{R}first_screen.py::test_every_engine_has_a_colour_and_a_mark_of_its_own",
    ),
    Defect(
        f"{E}/mujoco/urdf.py",
        "[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],",
        "[cy * cp, cy * sp * sr + sy * cr, cy * sp * cr + sy * sr],",
        f"{EXCHANGE}::test_roll_pitch_and_yaw_of_a_loop_turn_its_axis",
    ),
    # engines that the other tables leave out, and files of other programs
    Defect(f"{E}/simbody/model.py", "force.setViscosity(load.damping)", "force.setViscosity(0.0)", ALIKE),
    Defect(f"{E}/simbody/adapter.py", "found.append(-wrench(force", "found.append(wrench(force", ALIKE),
    Defect(
        f"{E}/simbody/model.py",
        "s.frequency, s.phase, driver.polynomial[0])",
        "s.frequency, 0.0, driver.polynomial[0])",
        f"{SIMBODY}::test_drivers_and_the_motion_they_prescribe",
    ),
    Defect(
        f"{E}/ondsel/adapter.py",
        "moment + np.cross(first - second, force)",
        "moment - np.cross(first - second, force)",
        f"{ONDSEL}::test_ondsel_and_pinocchio_on_every_joint",
    ),
    Defect(
        f"{E}/exudyn/joints.py",
        "(0, 0, 1, 1, 1, 0), torques=ACROSS",
        "(0, 0, 1, 1, 1, 0), torques=()",
        f"{C}exudyn_reactions.py",
    ),
    Defect(
        f"{E}/exudyn/model.py",
        "offset=load.natural_angle,",
        "offset=0.0,",
        f"{C}exudyn.py::test_torsion_spring_beyond_a_turn_and_closed_form_agree",
    ),
    Defect(
        f"{E}/pinocchio/model.py",
        "spring.damping * rate) * along",
        "spring.damping * abs(rate)) * along",
        f"{C}tree_engines.py",
    ),
    Defect(
        f"{E}/mujoco/reading.py",
        "float(model.qpos_spring[q] - model.qpos0[q])",
        "float(model.qpos0[q] - model.qpos_spring[q])",
        EXCHANGE,
    ),
    Defect(
        "crosscheck/study/grid.py",
        'record["time_limit"] < time_limit',
        'record["time_limit"] > time_limit',
        f"{C}study.py::test_timed_out_case_is_repeated_with_a_longer_limit_only",
    ),
    Defect("crosscheck/study/wording.py", "math.ceil(value /", "math.floor(value /", VERDICT),
)
