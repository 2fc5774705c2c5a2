"""Broken, binary, deep and impossible files are refused with a sentence and exit status 2."""

import re

import pytest

BODY = """<mujoco><worldbody><body name="a">
<joint name="j" axis="0 1 0" stiffness="1" damping="1" armature="1"/>
<inertial pos="0 0 1" mass="1" diaginertia="2 2 2"/></body></worldbody><option gravity="0 0 -9"/>
<keyframe><key name="k" qpos="3"/></keyframe></mujoco>"""
ROBOT = """<robot name="m"><link name="base"/><link name="a"><inertial><mass value="1"/>
<inertia ixx="2" ixy="0" ixz="0" iyy="2" iyz="0" izz="2"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/>
<origin xyz="0 0 7"/><axis xyz="0 1 0"/><dynamics damping="3"/></joint></robot>"""
MODEL = """<sdf version="1.9"><model name="m"><link name="a"><pose>0 0 7 0 0 0</pose>
<inertial><mass>1</mass><inertia><ixx>2</ixx><iyy>2</iyy><izz>2</izz></inertia></inertial></link>
<joint name="j" type="revolute"><parent>world</parent><child>a</child>
<axis><xyz>0 1 0</xyz><dynamics><damping>3</damping></dynamics></axis></joint></model></sdf>"""
PLACES = [  # a right file, its name, a text in it, the text with another number, and the part that has it
    (BODY, "a.xml", 'mass="1"', 'mass="{}"', "body 'a'"),
    (BODY, "a.xml", 'diaginertia="2 2 2"', 'diaginertia="{0} {0} {0}"', "body 'a'"),
    (BODY, "a.xml", "0 0 1", "0 0 {}", "body 'a'"),
    (BODY, "a.xml", "0 1 0", "0 {} 0", "joint 'j'"),
    (BODY, "a.xml", 'stiffness="1"', 'stiffness="{}"', "joint 'j'"),
    (BODY, "a.xml", 'damping="1"', 'damping="{}"', "joint 'j'"),
    (BODY, "a.xml", 'armature="1"', 'armature="{}"', "joint 'j'"),
    (BODY, "a.xml", "0 0 -9", "0 0 {}", "gravity"),
    (BODY, "a.xml", 'qpos="3"', 'qpos="{}"', "keyframe 'k'"),
    (ROBOT, "a.urdf", 'mass value="1"', 'mass value="{}"', "link 'a'"),
    (ROBOT, "a.urdf", 'izz="2"', 'izz="{}"', "link 'a'"),
    (ROBOT, "a.urdf", "0 0 7", "0 0 {}", "joint 'j'"),
    (ROBOT, "a.urdf", "0 1 0", "0 {} 0", "joint 'j'"),
    (ROBOT, "a.urdf", 'damping="3"', 'damping="{}"', "joint 'j'"),
    (MODEL, "a.sdf", "<mass>1", "<mass>{}", "link 'a'"),
    (MODEL, "a.sdf", "<izz>2", "<izz>{}", "link 'a'"),
    (MODEL, "a.sdf", "0 0 7", "0 0 {}", "link 'a'"),
    (MODEL, "a.sdf", "0 1 0", "0 {} 0", "joint 'j'"),
    (MODEL, "a.sdf", "<damping>3", "<damping>{}", "joint 'j'"),
]


BY_MUJOCO = {  # numbers that MuJoCo's own reader refuses first
    *(('mass="1"', "-inf"), ('mass="1"', "nan"), ('diaginertia="2 2 2"', "-inf")),
    *(('diaginertia="2 2 2"', "nan"), ("0 0 1", "nan")),
}


@pytest.mark.parametrize("number", ["1e300", "inf", "-inf", "nan"])
@pytest.mark.parametrize(("text", "name", "old", "new", "part"), PLACES)
def test_part_with_a_number_that_is_huge_or_not_finite_is_named(files, text, name, old, new, part, number):
    """The error begins with the body, link or joint, or with the refusal by MuJoCo's own reader."""
    expected = "MuJoCo cannot read it: " if (old, number) in BY_MUJOCO else f"{part}: "
    assert expected in files.refusal(text.replace(old, new.format(number)), name)


@pytest.mark.parametrize(
    ("text", "name", "old", "new", "says"),
    [
        (ROBOT, "a.urdf", 'izz="2"', 'izz="5"', "link 'a'.*2, 2, 5 kg m²"),
        (MODEL, "a.sdf", "<izz>2", "<izz>5", "link 'a'.*2, 2, 5.*<ixx>, <iyy>, <izz>"),
        (MODEL, "a.sdf", "<damping>3", "<damping>-1", "joint 'j': dynamics.*damping.*-1"),
    ],
)
def test_moments_and_dampers_that_no_body_has_are_refused_with_their_part(files, text, name, old, new, says):
    """5 > 2 + 2 kg m²; a damper with a negative coefficient would drive the joint. The sentence does not name
    "balanceinertia", an option of MuJoCo alone."""
    said = files.refusal(text.replace(old, new), name)
    assert re.search(says, said) and "balanceinertia" not in said, said


OTHERS = [(name, f"{name}: is no XML: ") for name in ("a.urdf", "a.sdf")]
READERS = [("a.xml", "MuJoCo cannot read it: "), *OTHERS]
NO_XML = [b"", b"\xff\xfe\x00<", bytes(range(256)), b"<robot", b"<sdf version='1.9'><model", b"[1, 2]"]


@pytest.mark.parametrize(("name", "says"), READERS)
@pytest.mark.parametrize("text", NO_XML)
def test_a_file_that_is_no_xml_is_refused_by_the_reader_of_its_format(files, name, says, text):
    """The suffix of the name decides the format: MuJoCo reads .xml."""
    assert says in files.refusal(text, name)


@pytest.mark.parametrize(
    ("name", "says"),
    [("a.xml", "has no body"), ("a.urdf", "MuJoCo cannot read it: "), ("a.sdf", "has no model")],
)
def test_an_empty_mjcf_model_is_refused_under_the_suffix_of_each_format(files, name, says):
    """The suffix chooses the reader: the root <mujoco> is right in .xml only, and there it has no body."""
    assert says in files.refusal(b"<mujoco/>", name)


@pytest.mark.parametrize("name", ["a.urdf", "a.sdf"])
def test_an_unknown_encoding_is_refused_with_a_sentence_on_the_encoding(files, name):
    """The first line of a right file names the encoding "none-such"."""
    text = {"a.urdf": ROBOT, "a.sdf": MODEL}[name]
    assert "encoding" in files.refusal(f'<?xml version="1.0" encoding="none-such"?>{text}', name)


def test_a_file_in_utf_16_is_read_with_the_names_of_its_links(files):
    """The SDF file's only link is named "é"."""
    text = '<?xml version="1.0" encoding="utf-16"?>' + MODEL.replace('name="a"', 'name="é"')
    text = text.replace("<child>a", "<child>é")
    scene, _ = files.scene(text.encode("utf-16"), "a.sdf")
    assert [body.name for body in scene.body] == ["é"]


@pytest.mark.parametrize("deep", [300, 5000])
def test_elements_nested_too_deep_are_refused_with_their_depth(files, deep):
    """In URDF, ``deep`` nested elements stand in the root, which is one level more. In SDF, ``deep`` nested
    models stand in the root, and the innermost one has a link: two levels more."""
    urdf = ROBOT.replace("</robot>", f"{'<more>' * deep}{'</more>' * deep}</robot>")
    assert f"nested {deep + 1} deep; at most 200 are read" in files.refusal(urdf, "a.urdf")
    models = "".join(f"<model name='m{k}'><link name='l'/>" for k in range(deep)) + "</model>" * deep
    said = files.refusal(f"<sdf version='1.9'>{models}</sdf>", "a.sdf")
    assert f"nested {deep + 2} deep; at most 200 are read" in said


def test_a_chain_of_300_links_or_bodies_is_refused_with_its_length(files):
    """Links of a URDF or bodies of an MJCF file carry each other; the limit of the import is 200."""
    many = 300
    joint = '<joint name="j{0}" type="continuous"><parent link="l{0}"/><child link="l{1}"/></joint>'
    links = "".join(f'<link name="l{k}"/>' for k in range(many + 1))
    joints = "".join(joint.format(k, k + 1) for k in range(many))
    said = files.refusal(f'<robot name="r">{links}{joints}</robot>', "a.urdf")
    assert f"links carry each other {many} deep; at most 200 are read" in said
    bodies = "<body><joint/><geom size='1'/>" * many + "</body>" * many
    said = files.refusal(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>", "a.xml")
    assert f"bodies carry each other {many} deep; at most 200 are read" in said


@pytest.mark.parametrize(
    ("configuration", "says"),
    [
        (b"<model><sdf", "is no XML"),
        (bytes(range(256)), "is no XML"),
        (b"", "is no XML"),
        (b"<model><sdf version='new'>model.sdf</sdf></model>", "version 'new': is no version of SDF"),
        (b"<model><sdf version='1.5'/></model>", "<sdf> names no file"),
    ],
)
def test_a_broken_configuration_of_an_included_model_is_named(files, configuration, says):
    """A world includes the model arm by its folder, whose model.config names the file of the model."""
    place = files.folder / "arm"
    place.mkdir()
    (place / "model.config").write_bytes(configuration)
    (place / "model.sdf").write_text(MODEL)
    world = "<sdf version='1.9'><world name='w'><include><uri>model://arm</uri></include></world></sdf>"
    said = files.refusal(world, "w.sdf")
    assert says in said and "model.config" in said


def test_models_that_include_each_other_400_deep_are_refused(files):
    """Each of 400 files includes the next one."""
    for k in range(400):
        inside = f"<include><uri>m{k + 1}.sdf</uri></include><link name='l'/>"
        text = f"<sdf version='1.9'><model name='m{k}'>{inside}</model></sdf>"
        (files.folder / f"m{k}.sdf").write_text(text)
    text = "<sdf version='1.9'><model name='m'><include><uri>m0.sdf</uri></include></model></sdf>"
    assert "models are nested more than 200 deep" in files.refusal(text, "m.sdf")


@pytest.mark.parametrize("version", ["abc", "", "1.x", "1..6"])
def test_an_sdf_version_that_is_not_a_number_is_refused(files, version):
    """Versions are two numbers with a point, such as 1.9."""
    assert "is no version of SDF" in files.refusal(MODEL.replace("1.9", version), "a.sdf")
