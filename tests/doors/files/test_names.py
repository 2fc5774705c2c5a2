"""Names of scenes, bodies and joints in file names, commands, pages and pictures."""

import dataclasses
import json
import re
import shlex
from xml.etree import ElementTree

import matplotlib.figure
import pytest
from markdown_it import MarkdownIt

import mbref
from crosscheck.cli import main as crosscheck
from crosscheck.study.command import command
from mbref.cli import main
from mbref.cli.run import show
from mbref.files import file_name
from mbref.scene import Scene, SceneError
from mbref.scenes import find_scene
from reports import sections
from reports.__main__ import main as report
from reports.blocks import Card, Figure, Heading, Listing, Matrix, Record, Table, Text, Verdict
from reports.figures import svg
from reports.keep import keep
from reports.render import html, markdown
from reports.runs import Run, SceneRuns
from reports.speed_figure import speed_svg
from reports.stored import groups
from tests.helpers.falling_engine import STONE
from tests.helpers.parts import hinge
from tests.reports import synthetic

FALLING = "tests.helpers.falling_engine:ENGINE"
NAMES = [
    *("../../other", "/etc/passwd", "a/b", "two words", 'it\'s "quoted"', "$(touch pwned)", "`touch pwned`"),
    *("<img src=x onerror=alert(1)>", "[link](http://example.org)", "$x_1$ {y}", "--out=x", "..", "ü" * 100),
    "a|b & c;d",
]
MARKUP = (
    *("[red]x[/]", "[/nothing]", "$x_1$", "../../up", "a/b"),
    *("<b>&amp;</b>", "a|b", "Türe α", "%s {0}", "ground "),
)


def named(name: str) -> Scene:
    """Return a pendulum, all parts of which have a name."""
    bodies = [{"name": name, "mass": 1.0, "inertia": [0.1, 0.1, 0.1], "position": [1.0, 0.0, 0.0]}]
    hinges = [hinge(f"{name}'", "ground", name, (0.0, 0.0, 0.0))]
    return Scene(name=name, gravity=(0.0, -9.81, 0.0), duration=0.01, body=bodies, joint=hinges)


def test_file_names_of_different_names_differ_and_are_safe_words_of_a_shell(tmp_path):
    """A word is safe if `shlex.quote` leaves it as it is, except for ü, which it quotes and shells need not.
    The file name of a plain name, "four_bar-2", is the name itself. None has 100 bytes."""
    found = {file_name(name) for name in NAMES}
    assert len(found) == len(NAMES) and file_name("four_bar-2") == "four_bar-2"
    for name in found:
        assert (tmp_path / f"{name}.toml").parent == tmp_path
        assert shlex.quote(plain := name.replace("ü", "u")) == plain and not name.startswith(("-", "."))
        assert len(name.encode()) < 100


@pytest.mark.parametrize("name", ["../../up", "$x_1$ {y}", "<img src=x> & '", "$(touch pwned)", "_hidden"])
def test_pictures_of_any_name_are_xml_in_the_folder_and_legends_show_it(name, tmp_path, monkeypatch, capsys):
    """An XML parser reads the pictures of three commands. A legend shows the name letter by letter: what
    stands between dollar signs is no formula of matplotlib (``get_parse_math``)."""
    monkeypatch.chdir(tmp_path)
    named(name).save("scene.toml")
    assert main(["draw", "scene.toml"]) == 0
    assert main(["plot", "scene.toml", "--samples", "3", "--out", "plot.svg"]) == 0
    assert main(["animate", "scene.toml", "--samples", "3"]) == 0
    for path in tmp_path.glob("*.svg"):
        ElementTree.fromstring(path.read_text())
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"scene.toml", "scene.svg", "plot.svg", "scene-moving.svg"}
    figure = mbref.simulate(named(name), times=[0.0, 0.01]).plot(f"{name}.position")
    legend = figure.axes[0].get_legend().get_texts()
    assert [text.get_text() for text in legend] == [f"{name}.position.{axis}" for axis in "xyz"]
    assert not any(text.get_parse_math() for text in legend)


@pytest.mark.parametrize(
    "name", ["a\x1b[31m", "line\nbreak", "tab\t", "\x7f", "\u202eback", "nul\x00", "n" * 201, "n " * 2500]
)
def test_control_characters_in_names_and_endless_names_are_refused_in_short_messages(name):
    """A name may have 200 characters. Messages show no control character and have fewer than 200, too."""
    with pytest.raises(SceneError, match=r"must have (no control|at most 200) character") as refused:
        named(name)
    assert max(map(len, refused.value.faults)) < 200
    assert str(refused.value).replace("\n", " ").isprintable()


@pytest.mark.parametrize("name", NAMES)
def test_page_and_markdown_of_a_report_show_a_name_without_acting_on_its_markup(name):
    """CommonMark finds no HTML, link or emphasis; the heading is the name without backticks (code)."""
    card = Card("k-1", name, "right", "✓", {}, name, shlex.join(["crosscheck", "run", name]), name)
    verdict = Verdict(name, name, name, [name], "", "")
    blocks = [
        Heading(name, 2),
        Text(name),
        Table(name, [name], [[name]]),
        Figure("figure", name, lambda: "<svg/>"),
        Record("r-1", name, name, 0, [card], "c-1"),
        Matrix(name, [("e", name, 0, "")], [(name, name)], {name: {"e": [verdict]}}),
        Listing(f"```\n{name}"),
    ]
    assert "<img src=x" not in html(blocks, {"figure": "<svg/>"}, name)
    tokens = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(markdown(blocks, name))
    inner = [token for block in tokens for token in (block, *(block.children or ()))]
    markup = {"html_inline", "html_block", "link_open", "em_open", "s_open"}
    assert not {token.type for token in inner} & markup
    heading = next(block for block in tokens if block.type == "inline").children
    assert "".join(token.content for token in heading) == name.replace("`", "")
    assert [token.content for token in tokens if token.type == "fence"] == [f"```\n{name}\n"]


def test_figures_of_a_report_show_a_name_letter_by_letter():
    """Dollar signs, underscores and braces begin no formula; `<` is escaped once."""
    figure = matplotlib.figure.Figure()
    figure.text(0.5, 0.5, "$x_1$ {y} <b>")
    assert "$x_1$ {y} <b>" in "".join(ElementTree.fromstring(svg(figure, "one")).itertext())


@pytest.mark.parametrize("name", NAMES)
def test_printed_commands_of_a_report_name_the_scene_file_as_one_word(name):
    """`shlex.split` reads a command as a shell does. The command of a run's card and the one of the report
    name the scene's file; `command` writes the run's command for a file at another path."""
    group = SceneRuns(synthetic.scene().with_(name=name), [Run({**synthetic.records()[0], "scene": name})])
    blocks = [*sections.records.render([group]), *sections.provenance.render([group])]
    printed = [card.command for block in blocks if isinstance(block, Record) for card in block.cards]
    printed += [line for b in blocks if isinstance(b, Listing) for line in b.text.splitlines()[1:]]
    assert len(printed) == 2
    ElementTree.fromstring(speed_svg(group, name))  # is XML, whatever the name
    for line in printed:
        assert f"scenes/{file_name(name)}.toml" in shlex.split(line), line
    path = f"a folder/{name}.toml"
    assert path in shlex.split(command(group.runs[0].record, shlex.quote(path)))


@pytest.mark.parametrize("name", ["../../other", "a/b", "two words"])
def test_report_and_its_pack_keep_a_scene_of_any_name_in_their_folder(name, tmp_path, capsys):
    """No file is outside of the folders a and c. The command that the report prints names the scene's file,
    in the folder of the page, and the packed records have its name."""
    scene, out, packed = tmp_path / "scene.toml", tmp_path / "a" / "b", tmp_path / "c" / "d"
    STONE.with_(name=name).save(scene)
    asked = ["--engine", FALLING, "--quick", "--section", "provenance", "--out", str(out)]
    assert report([str(scene), *asked]) == 0
    (kept,) = {*tmp_path.rglob("*.toml")} - {scene}
    assert kept.parent == out / "scenes" and find_scene(kept) == find_scene(scene)
    words = shlex.split((out / "report.md").read_text().rpartition("crosscheck report")[2].strip("`\n"))
    assert out / words[0] == kept and words[1:] == ["--out", "."]
    keep(groups(out), packed)
    assert [group.scene.name for group in groups(packed)] == [name]
    assert {path.name for path in tmp_path.iterdir()} == {"scene.toml", "a", "c"}


def test_printed_commands_name_a_scene_file_in_any_folder_as_one_word(tmp_path, capsys):
    """The next step after `mbref new`, and the runs that `crosscheck tune` and `crosscheck compare` print."""
    path = tmp_path / "my scenes" / "it's.toml"
    path.parent.mkdir()
    assert main(["new", str(path)]) == 0
    printed = [capsys.readouterr().out.rpartition("next, ")[2]]
    STONE.save(path)
    assert crosscheck(["tune", FALLING, str(path), "--json"]) == 0
    printed += [record["command"] for record in json.loads(capsys.readouterr().out)["records"]]
    assert crosscheck(["compare", str(path), "--engine", FALLING]) == 0
    printed += re.findall("crosscheck run .*", capsys.readouterr().out)
    assert len(printed) == 3
    for line in printed:
        assert str(path) in shlex.split(line), line


@pytest.mark.parametrize("name", [*NAMES, "back\\slash", "\\u0041", "[/nothing]", "%s {0}", "ground "])
def test_scene_files_and_json_give_a_name_back(name, tmp_path, capsys):
    """Quotes and backslashes are escaped in TOML and in JSON."""
    named(name).save(tmp_path / "scene.toml")
    assert main(["diagnose", str(tmp_path / "scene.toml"), "--start", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scene"] == name


@pytest.mark.parametrize("name", MARKUP)
def test_run_s_table_shows_a_name_literally(name, capsys):
    """The scene, its body, the method and the message of the run have this name: it is shown four times.
    MARKUP are names that look like markup of terminals, HTML and formulas, or like paths."""
    run = dataclasses.replace(mbref.simulate(named(name), times=[0.0]), method=name, message=name)
    show(run.mechanism, run)
    out = capsys.readouterr().out
    assert out.count(name.strip()) >= 4, out


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("x" * 5000, "x: File name too long"),
        ("a\nb", r"unknown scene 'a\nb'"),
        (".", ".: cannot be read: Is a directory"),
        ("/", "/: cannot be read: Is a directory"),
        ("", "unknown scene ''"),
    ],
)
def test_name_of_no_scene_and_no_file_is_refused_in_one_line(name, says, capsys):
    """Messages have less than 700 characters, also for a name of 5000; the status is 2."""
    assert main(["diagnose", name]) == 2
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1 and len(said) < 700
