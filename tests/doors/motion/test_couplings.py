"""Couplings of joint coordinates and armatures: closed forms, equations, reactions, faults."""

import pytest

import mbref
from mbref.scene import JOINT_TYPES, SceneError
from tests.helpers import coupled_mechanisms
from tests.helpers.coupled_mechanisms import gear_pair, pendulum

AT_MOST_NINE = "numbers, such as [0.0, 6.0], of a coupling at most nine"
NO_END = "must not end with 0, which has no influence"
NO_SLIDE = "is revolute, which has no displacement to be coupled"


def test_counts_list_the_rows_of_couplings_and_rotors():
    """A hinge has 5 rows; an armature is a rotor, a body of its own, held by 6; a coupling has 1."""
    counts = mbref.diagnose(coupled_mechanisms.planetary()).counts
    assert counts.rows_by_joint == {"A": 5, "B": 5, "armature of A": 6, "armature of B": 6, "mesh": 1}
    assert counts.degrees_of_freedom == 1


@pytest.mark.parametrize(
    ("kind", "coordinate"),
    [
        ("revolute", "angle"),
        ("cylindrical", "angle"),
        ("planar", "angle"),
        ("translational", "displacement"),
        ("inline", "displacement"),
    ],
)
def test_coupling_takes_the_angle_of_a_joint_that_has_one_and_otherwise_the_displacement(kind, coordinate):
    """The pinion of the gear pair gets a joint of each type; the coupling states no coordinates."""
    axle = JOINT_TYPES[kind].at("A", ("ground", "disc"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    scene = gear_pair()
    scene = scene.with_(joint=(axle.model_copy(update={"bodies": scene.joint[0].bodies}), scene.joint[1]))
    assert [end for _, end in scene.coupled(scene.coupling[0])] == [coordinate, "angle"]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"joints": ["A", "C"]}, "coupling[teeth].joints[1]: unknown joint 'C'; known: A, B"),
        ({"joints": ["A", "A"]}, f"coupling[teeth].joints: 'A' {NO_SLIDE}"),
        ({"ratio": 0.0}, "coupling[teeth].ratio: must not be 0, which would lock the second joint"),
        ({"coordinates": ["angle", "displacement"]}, f"coupling[teeth].joints: 'B' {NO_SLIDE}"),
        ({"name": "A"}, "coupling[A].name: 'A' is already the name of a joint"),
        ({"joints": ["A"]}, "coupling[teeth].joints: must be two or more names of joints, got ['A']"),
        ({"polynomial": [1.0, 2.0]}, "coupling[teeth].polynomial: or ratio, not both"),
        ({"ratio": None, "polynomial": [1.0, 0.0]}, f"coupling[teeth].polynomial: {NO_END}"),
        (
            {"ratio": None, "polynomial": [1.0, "2 m"]},
            "coupling[teeth].polynomial[1]: is in rad/rad^2, got '2 m'",
        ),
        (
            {"ratio": None, "polynomial": [1] * 10},
            f"coupling[teeth].polynomial: must be {AT_MOST_NINE}, got [1, 1, 1, 1, 1, 1, ...]",
        ),
        ({"ratoi": 1.0}, "coupling[teeth].ratoi: is not a known field; did you mean 'ratio'?"),
    ],
)
def test_fault_of_a_coupling_is_named_by_its_field(change, fault):
    """A right coupling `teeth` of the hinges A and B gets one change, which is the only fault reported.
    AT_MOST_NINE, NO_END and NO_SLIDE are the rest of a sentence."""
    entry = {"name": "teeth", "joints": ["A", "B"], "ratio": -0.5} | change
    with pytest.raises(SceneError) as found:
        gear_pair(coupling=[entry])
    assert found.value.faults == [fault]


def test_drawing_shows_a_coupling_as_a_dotted_line():
    """The SVG of a gear pair has strokes of dashes of 1 px in gaps of 5 px; that of a pendulum has none."""
    assert 'stroke-dasharray="1 5"' in mbref.still(gear_pair())
    assert 'stroke-dasharray="1 5"' not in mbref.still(pendulum())
