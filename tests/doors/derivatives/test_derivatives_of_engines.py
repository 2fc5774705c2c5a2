"""The command `crosscheck derivatives` on engines, and on those of tests/zoo/gradients, each with one planted
fault (NONE has none). A card is an identity that right derivatives satisfy, such as virtual work."""

import json

import pytest

from crosscheck.cli import main
from crosscheck.derivatives import compare, sentences
from crosscheck.derivatives.cards import CARDS, Subject, verdicts
from crosscheck.derivatives.mechanisms import MECHANISMS, SPATIAL
from crosscheck.derivatives.records import read
from crosscheck.engine import engine, installed
from crosscheck.engines.drake.adapter import ENGINE
from mbref.records import rewrite
from mbref.scene import Scene
from tests.zoo.gradients import ENGINES

ZOO = "tests.zoo.gradients"
MOVES, RESTS, OPENS = "only in motion", "also at rest", "off the constraints"
FOUND = {  # engine of the zoo: words of the sentence on the cause
    "NONE": "",
    "VELOCITY_SIGN": MOVES,
    "NO_VELOCITY_TERMS": MOVES,
    "HALF_VELOCITY_TERMS": MOVES,
    "CONSTANT_JACOBIAN": RESTS,
    "FORCE_SIGN": RESTS,
    "CONSTANT_ROWS": RESTS,
    "CONSTANT_MULTIPLIERS": RESTS,
    "UNSTABILISED": OPENS,
    "QUATERNION": RESTS,
    "FREE_BODIES": RESTS,
    "TRANSPOSED": RESTS,
    "NAN": RESTS,
    "NAN_BY_FORCE": RESTS,
}
WHIRLING = {"CONSTANT_INERTIA": RESTS, "NO_GYROSCOPIC": MOVES}  # shown by a body with turning principal axes


def pinned() -> Scene:
    """Return a body that turns and slides on a pin while a link of constant length holds it."""
    place = {"position": [0.4, 0.2, 0.1], "angular_velocity": [0.0, 0.0, 3.0]}
    pin = {"name": "pin", "type": "cylindrical", "bodies": ["ground", "b"], "anchor": [0.0, 0.0, 0.0]}
    link = {"name": "link", "type": "distance", "bodies": ["ground", "b"]}
    joints = [{**pin, "axis": [0.0, 0.0, 1.0]}, {**link, "anchors": [[0.7, -0.3, 0.6], [0.5, 0.4, 0.2]]}]
    bodies = [{"name": "b", "mass": 1.3, "inertia": [0.02, 0.03, 0.04], **place}]
    return Scene(name="pin", gravity=(0.0, -3.0, -9.0), duration=1.0, body=bodies, joint=joints)


@pytest.fixture
def loop(tmp_path) -> str:
    """Return the path of a loop."""
    pinned().save(tmp_path / "loop.toml")
    return str(tmp_path / "loop.toml")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "scene", "words"),
    [*((n, pinned(), FOUND[n]) for n in FOUND), *((n, SPATIAL[0].make(), WHIRLING[n]) for n in WHIRLING)],
    ids=[*FOUND, *WHIRLING],
)
def test_each_faulty_gradient_of_the_zoo_is_found_with_its_cause(name, scene, words):
    """FOUND has where each is wrong: terms of velocities vanish at rest, stabilisation on closed loops."""
    said = [*sentences.of_rows([*compare.rows(ENGINES[name], scene)])]
    assert len(said) == bool(words)
    assert all("wrong by" in sentence and words in sentence for sentence in said)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_each_faulty_gradient_fails_a_card_and_a_right_one_passes_all_cards(name):
    """NONE is right. A failure without a reason is an error that exceeds the card's limit."""
    first = next((verdict for verdict in verdicts(ENGINES[name]) if verdict.fails), None)
    assert (first is None) == (name == "NONE"), first
    assert first is None or not first.reason


@pytest.mark.parametrize(
    ("card", "fault"),
    [
        *(("closures", "VELOCITY_SIGN"), ("energy", "FORCE_SIGN"), ("virtual work", "NO_GYROSCOPIC")),
        *(("order", "NAN"), ("closures", "NAN_BY_FORCE")),
    ],
)
def test_cards_find_faults_of_a_body_on_a_link_without_the_judges_derivatives(card, fault):
    """NONE, without fault, satisfies an identity to rounding; a fault violates it by more than 1e-3."""
    scene = SPATIAL[0].make()
    right, wrong = (CARDS[card].check(Subject(ENGINES[name], "own"), scene) for name in ("NONE", fault))
    assert right <= 1e-11 and wrong > 1e-3


@pytest.mark.slow
def test_command_prints_the_cards_that_an_engine_passes(capsys):
    """mbref passes all; "differences" is not asked, as it has no accelerations off the constraints."""
    assert main(["derivatives", "mbref", "--cards", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["cards"]
    assert {each["card"] for each in found} == {*CARDS} and not any(each["fails"] for each in found)
    assert max(each["error"] for each in found if each["card"] != "differences") <= 1e-7


def test_card_that_has_nothing_to_compare_gives_a_reason_in_place_of_a_pass():
    """mbref has no accelerations off the constraints; MuJoCo has no derivatives by forces."""
    (own, *_), (forces, *_) = verdicts(engine("mbref"), ["differences"]), verdicts(engine("mujoco"), [])
    assert (own.error, forces.error) == (None, None)
    assert "along allowed motions only" in own.reason
    assert "no derivatives by forces" in forces.reason


@pytest.mark.slow
@pytest.mark.parametrize(("name", "words"), [("NONE", ""), ("VELOCITY_SIGN", MOVES), ("NAN", RESTS)])
def test_command_fails_if_a_derivative_is_wrong_and_says_on_what_it_depends(loop, name, words, capsys):
    """NONE is right. VELOCITY_SIGN has the wrong sign of J̇ v, which is zero at rest: status 1."""
    assert main(["derivatives", f"{ZOO}:{name}", loop]) == bool(words)
    printed = capsys.readouterr().out
    assert ("wrong by" in printed) == bool(words) and words in printed


def test_mbref_is_right_and_an_engine_that_lacks_derivatives_is_refused_as_lacking_them(tmp_path, capsys):
    """The judge's derivatives for a body on a pin are the truth; `make deep` has loops. Exudyn has none."""
    scene = pinned()
    scene.with_(joint=scene.joint[:1]).save(tmp_path / "pin.toml")
    assert main(["derivatives", "mbref", "exudyn", str(tmp_path / "pin.toml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["grade"] for row in found["rows"]} == {"right"}
    assert max(row["error"] for row in found["rows"]) <= 1e-11
    assert {row["by"] for row in found["rows"]} == {"position", "velocity", "force", "number"}
    (refused,) = found["refused"]
    assert "exudyn" in refused["engine"] and "missing in the engine" in refused["reason"]


def test_command_shows_the_committed_results_or_those_of_another_file(tmp_path, capsys):
    """Committed are all MECHANISMS. A file with mbref's records alone gives a page without Pinocchio."""
    assert main(["derivatives", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["scene"] for row in found["rows"]} == {mechanism.name for mechanism in MECHANISMS}
    assert {row["grade"] for row in found["rows"] if row["engine"] == "mbref"} == {"right"}
    records, out = tmp_path / "few.jsonl", tmp_path / "page.md"
    rewrite(records, [record for record in read() if record["engine"] == "mbref"])
    assert main(["derivatives", "--records", str(records), "--page", str(out)]) == 0
    assert "(#mbref)" in out.read_text() and "(#pinocchio)" not in out.read_text()


@pytest.mark.slow
@pytest.mark.skipif(not installed("pinocchio"), reason="needs Pinocchio")
def test_pinocchio_is_right_about_a_link_of_constant_length_that_its_adapter_makes_a_rod(loop, capsys):
    """The rod has inertia about its axis, but no spin. Six errors are by position, velocity and force, each
    in motion and at rest."""
    main(["derivatives", "pinocchio", loop, "--json"])
    found = json.loads(capsys.readouterr().out)["rows"]
    judged = [row for row in found if row["truth"] == "judge" and row["function"] == "LOCAL"]
    assert len(judged) == 6 and max(row["error"] for row in judged) <= 1e-8


@pytest.mark.slow
@pytest.mark.skipif(not installed("drake"), reason="needs Drake")
def test_drakes_terms_are_differentiated_right_also_with_open_loops(loop, capsys):
    """The truth is the judge's, and with open loops differences of the accelerations by Drake's terms."""
    assert main(["derivatives", "drake", loop, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["rows"]
    assert {row["grade"] for row in found} == {"right"}
    assert {row["state"] for row in found} == {"moving", "at rest", "open loops"}


@pytest.mark.slow
def test_mujocos_derivatives_are_right_about_a_turning_body_whose_line_slides_along_a_point(tmp_path, capsys):
    """The judge's are the truth. MuJoCo's model is a ball joint and, behind it, a slide of one body."""
    body = {"name": "b", "mass": 1.3, "inertia": [0.02, 0.03, 0.04], "position": [0.1, 0.0, 0.2]}
    line = {"name": "J", "type": "inline", "bodies": ["b", "ground"], "axis": [0.6, 0.0, -0.8]}
    joint, turning = {**line, "anchor": [0.3, 0.1, 0.0]}, {**body, "angular_velocity": [1.0, 2.0, 3.0]}
    Scene(name="line", gravity=(0.0, 0.0, -9.81), body=[turning], joint=[joint]).save(tmp_path / "line.toml")
    assert main(["derivatives", "mujoco", str(tmp_path / "line.toml"), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["grade"] for row in rows} == {"right"}


@pytest.mark.slow
@pytest.mark.skipif(not installed("pinocchio"), reason="needs Pinocchio")
def test_known_defects_of_pinocchios_derivatives_are_found(capsys):
    """By its two findings they are wrong by position if a loop is closed at a point (``pinned``), and off the
    constraints with Baumgarte's terms in LOCAL_WORLD_ALIGNED."""
    main(["derivatives", "pinocchio", "--json"])
    found = json.loads(capsys.readouterr().out)
    wrong = [row for row in found["rows"] if row["grade"] == "wrong"]
    pinned = {"ball_four_bar", "random_2", "fast_four_bar"}
    own = [row for row in wrong if row["truth"] == "own differences"]
    at_points = [row for row in own if row["scene"] in pinned]
    assert {row["scene"] for row in at_points} == pinned
    assert {row["by"] for row in at_points if "Baumgarte" not in row["function"]} == {"position"}
    others = [row for row in wrong if row["scene"] not in pinned]
    wrong = {(row["function"], row["state"]) for row in others}
    assert wrong == {("LOCAL_WORLD_ALIGNED, Baumgarte", "open loops")}


@pytest.mark.slow
@pytest.mark.skipif(not installed("mujoco"), reason="needs MuJoCo")
def test_mujoco_differentiates_its_own_step_and_is_rough_about_the_exact_motion(loop, capsys):
    """MuJoCo has soft closures: derivatives of its step are right; a rigid loop's differ by over 1e-7."""
    main(["derivatives", "mujoco", loop, "--json"])
    found = json.loads(capsys.readouterr().out)
    rows = {(row["truth"], row["function"]): [] for row in found["rows"]}
    for row in found["rows"]:
        rows[row["truth"], row["function"]].append(row["error"])
    assert max(rows["own differences", "hard"]) <= 1e-6
    assert 1e-7 <= max(rows["judge", "hard"]) <= 1e-2 < max(rows["judge", "defaults"])


@pytest.mark.slow
@pytest.mark.skipif(not installed("mjx"), reason="needs MJX")
def test_mjxs_step_is_differentiated_right_and_leaves_out_a_term_of_the_exact_motion(loop, capsys):
    """The finding mjx-connect-without-velocity-term: J̇ v is missing in closures. JAX compiles for minutes."""
    main(["derivatives", "mjx", loop, "--json"])
    found = json.loads(capsys.readouterr().out)["rows"]
    own = [row for row in found if row["truth"] == "own differences" and row["grade"] != "undecided"]
    assert {row["by"] for row in own} == {"position", "velocity", "force"}
    assert max(row["error"] for row in own) <= 1e-6
    assert any(row["grade"] == "wrong" for row in found if row["truth"] == "judge")


@pytest.mark.slow
@pytest.mark.skipif(not installed("drake"), reason="needs Drake")
def test_drakes_terms_hold_a_gear_pair_in_a_loop_where_derivatives_are_taken():
    """Both cards ask for a gear pair and a cam. Drake's plant for derivatives has no constraints."""
    found = [*verdicts(ENGINE, ["couplings, closures", "couplings, virtual work"])]
    assert [verdict.error is not None for verdict in found] == [True, False] * 2  # a cam is refused
    assert not any(verdict.fails for verdict in found)
