"""The documentation: a page for every method, in the site's contents; commands that the parsers know."""

import dataclasses
import re
import sys
from pathlib import Path

import pytest
import yaml

from mbref.cli.commands import main
from mbref.formulations import FORMULATIONS
from mbref.integrators import INTEGRATORS, TAYLOR
from mbref.method import Method
from mbref.scene import JOINT_TYPES, LOAD_TYPES
from mbref.stabilisation import STABILISATIONS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
import method_pages  # noqa: E402

PAGES = sorted(DOCS.rglob("*.md"))
MADE = method_pages.pages()
METHODS = [*FORMULATIONS, *STABILISATIONS, *INTEGRATORS, TAYLOR.name]


def paths(entry: object) -> list[str]:
    """Pages of a part of the contents."""
    if isinstance(entry, str):
        return [entry]
    inside = entry.values() if isinstance(entry, dict) else entry
    return [path for part in inside for path in paths(part)]


def test_contents_of_the_site_name_every_page_once():
    """Pages are the files in docs and those that docs/method_pages.py writes."""
    contents = method_pages.with_formulations(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"])
    assert sorted(paths(contents)) == sorted([*(str(page.relative_to(DOCS)) for page in PAGES), *MADE])


@pytest.mark.parametrize("name", METHODS)
def test_page_of_a_method_has_equations_use_limits_and_measurements(name):
    """METHODS are all formulations, stabilisations and integrators. A page has a formula in $$, the
    paragraphs "Use it for" and "It fails on", and the section "Measured"."""
    text = MADE.get(f"methods/{name}.md") or (DOCS / "methods" / f"{name}.md").read_text()
    assert text.startswith(f"# `{name}`: ") and "$$" in text
    assert "**Use it for**: " in text and "**It fails on**: " in text and "## Measured" in text


def test_new_formulation_appears_in_list_table_page_and_contents(monkeypatch, capsys):
    """One entry in FORMULATIONS is enough. As lm1, of which it is a copy, it fails on redundant rows and
    handles singular mass matrices, the last two columns of the table."""
    about = FORMULATIONS["lm1"].about._replace(
        title="Thrown away", meaning="made by a test", formula="x", text="y", use="nothing", fails="all"
    )
    made = dataclasses.replace(FORMULATIONS["lm1"], name="thrown-away", about=about, equations="Eq. 0")
    monkeypatch.setitem(FORMULATIONS, made.name, made)
    assert main(["list", "methods"]) == 0 and "made by a test" in capsys.readouterr().out
    assert str(Method.parse("thrown-away+none/rk4"))
    assert "| Eq. 0 | fails | handled |" in method_pages.table(FORMULATIONS.values())
    text = method_pages.pages()["methods/thrown-away.md"]
    assert text.startswith("# `thrown-away`: Thrown away") and "**It fails on**: all" in text
    contents = method_pages.with_formulations([{"Choose": "methods.md"}, {"End": "end.md"}])
    assert {"thrown-away": "methods/thrown-away.md"} in contents and contents[-1] == {"End": "end.md"}


def test_page_of_methods_has_the_generated_table_of_formulations():
    """``with_table`` writes the table into the page, which must stay equal; ``with_links`` links names."""
    text = (DOCS / "methods.md").read_text()
    assert method_pages.with_table(text) == text, "python docs/method_pages.py renews the table"
    for name in FORMULATIONS:
        assert f"| `{name}` |" in text
        assert f"\n| [`{name}`](methods/{name}.md) |" in method_pages.with_links(text)


def test_every_method_in_a_measured_table_exists():
    """A comment "measured" above a table names its methods; an unknown name raises."""
    texts = [*(page.read_text() for page in PAGES), *MADE.values()]
    found = [m for text in texts for m in re.findall(r"<!-- measured: (.+?) -->", text)]
    names = [name for row in found for name in row.split()]
    assert names
    for name in names:
        Method.parse(name)


def test_page_of_the_scene_format_shows_a_figure_of_each_joint_and_load_and_no_other():
    """A figure that the page shows is drawn by docs/hooks.py when the site is built."""
    text = (DOCS / "scene-format.md").read_text()
    shown = re.findall(r"\]\(figures/((?:joint|load)_\w+)\.svg\)", text)
    wanted = [*(f"joint_{name}" for name in JOINT_TYPES), *(f"load_{name}" for name in LOAD_TYPES)]
    assert sorted(shown) == sorted(wanted)


def test_site_draws_a_figure_of_every_type_of_load():
    """LOADS and OF_SLIDES of docs/hooks.py list the loads that it draws when the site is built."""
    pytest.importorskip("mkdocs", reason="the extra docs builds the site")
    pytest.importorskip("latex2mathml", reason="the extra docs builds the site")
    import hooks

    assert {*hooks.LOADS, *hooks.OF_SLIDES} == set(LOAD_TYPES)


def test_page_of_robustness_names_only_existing_tests():
    """The page names more than 30 tests as proofs of its rows."""
    sources = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    named = set(re.findall(r"`(test_\w+)`", (DOCS / "robustness.md").read_text()))
    assert len(named) > 30
    assert not (missing := [name for name in named if f"def {name}(" not in sources]), missing
