"""Make the site's figures, measure its methods and set its formulas."""

from __future__ import annotations

import logging
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from latex2mathml.converter import convert
from mkdocs.structure.files import File

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref import find_scene, simulate
from mbref.motions.drawing.picture import moving, still
from mbref.motions.drawing.view import View
from mbref.scene import JOINT_TYPES, Scene

ROOT = Path(__file__).parents[1]
PAPER = ROOT / "reports" / "paper"
LOG = logging.getLogger("mkdocs.hooks.mbref")
OBLIQUE = View.parse("-60,22")
MEASURED = ("planar_slider_crank", "spatial_slider_crank", "four_bar")
MOVING = ("planar_slider_crank", "four_bar", "spatial_slider_crank", "flyball_governor", "bennett")
WHEELS = ("rolling", "rolling_line")
END = 0.1  # s, of the runs that are measured
BODIES = [
    {"name": "first", "mass": 1.0, "inertia": [0.01, 0.1, 0.1], "position": [-0.5, 0.0, 0.0]},
    {"name": "second", "mass": 1.0, "inertia": [0.01, 0.1, 0.1], "position": [0.4, 0.0, 0.4]},
]
HOLD = {
    "name": "A",
    "type": "revolute",
    "bodies": ["ground", "first"],
    "anchor": [-1, 0, 0],
    "axis": [0, 1, 0],
}
HINGE = {
    "name": "J",
    "type": "revolute",
    "bodies": ["first", "second"],
    "anchor": [0, 0, 0],
    "axis": [0, 1, 0],
}
LOADS = {
    "moment": {"type": "moment", "body": "second", "moment": [0, 1, 0]},
    "force": {"type": "force", "body": "second", "point": [0.8, 0, 0.8], "force": [1, 0, 0]},
    "spring": {
        "type": "spring",
        "bodies": ["first", "second"],
        "points": [[-0.7, 0, 0], [0.6, 0, 0.6]],
        "stiffness": 1.0,
        "natural_length": 1.0,
    },
    "rotational_damper": {"type": "rotational_damper", "bodies": ["first", "second"], "damping": 1.0},
    "point_damper": {
        "type": "point_damper",
        "bodies": ["first", "second"],
        "point": [0.6, 0, 0.6],
        "damping": 1.0,
    },
    "torsion_spring": {"type": "torsion_spring", "joint": "J", "stiffness": 1.0},
    "joint_torque": {"type": "joint_torque", "joint": "J", "torque": 1.0},
}
OF_SLIDES = {
    "slide_spring": {"type": "slide_spring", "joint": "J", "stiffness": 1.0},
    "joint_force": {"type": "joint_force", "joint": "J", "force": 1.0},
}


sys.path.insert(0, str(ROOT / "docs"))
from method_pages import CHOOSE, pages, with_formulations, with_links  # noqa: E402


def on_config(config: Any) -> Any:
    """Adds the pages of the formulations to the contents."""
    config["nav"] = with_formulations(config["nav"])
    return config


def on_files(files: Any, config: Any) -> Any:
    """Adds the figures, and the files of the project that pages link to."""
    for name, picture in figures().items():
        files.append(File.generated(config, f"figures/{name}.svg", content=picture))
    for path in sorted((PAPER / "figures").glob("*.svg")):
        files.append(File.generated(config, f"figures/{path.name}", content=path.read_bytes()))
    for path, text in pages().items():
        files.append(File.generated(config, path, content=text))
    for path in sorted(
        {link for file in files.documentation_pages() for link in _outside(file.content_string)}
    ):
        files.append(File.generated(config, f"source/{path}", content=(ROOT / path).read_bytes()))
    return files


def _outside(text: str) -> list[str]:
    """Files of the project outside docs that a page links to, as paths from the project's root."""
    found = [link.replace("../", "") for link in re.findall(r"\]\(((?:\.\./)+[^)#]+)\)", text)]
    return [link for link in found if not (ROOT / "docs" / link).exists() and (ROOT / link).is_file()]


def figures() -> dict[str, str]:
    """Pictures by name: every joint type, every load, drivers, and moving scenes."""
    found = {f"joint_{name}": still(joint_scene(name), OBLIQUE, 360) for name in JOINT_TYPES}
    pair = Scene(name="pair", body=BODIES, joint=[HOLD, HINGE])
    found |= {f"load_{name}": still(pair.with_(load=[load]), OBLIQUE, 360) for name, load in LOADS.items()}
    sliding = joint_scene("translational")
    found |= {f"load_{n}": still(sliding.with_(load=[x]), OBLIQUE, 360) for n, x in OF_SLIDES.items()}
    driven = pair.with_(driver=[{"joint": "J", "polynomial": [0.0, 1.0]}])
    found["driver"] = still(driven, View.parse("xz"), 360)
    for name in MOVING:
        scene = find_scene(name)
        found[f"motion_{name}"] = moving(scene, simulate(scene), width=400)
    return found


def joint_scene(kind: str) -> Scene:
    """Two bodies in a joint of a type, the first hinged to the ground."""
    places = {
        "anchor": (0.0, 0.0, 0.0),
        "anchors": ((0.0, 0.0, 0.0), (0.3, 0.0, 0.5)),
        "axis": (0.0, 1.0, 0.0) if kind in ("revolute", *WHEELS) else (1.0, 0.0, 0.0),
        "axes": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        "normal": (0.0, 0.0, 1.0),
        "along": (1.0, 0.0, 0.0),
        "radius": 0.3,
    }
    joint = JOINT_TYPES[kind].at("J", ("first", "second"), **places)
    return Scene(name=kind, body=BODIES, joint=[HOLD, joint])


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Fill tables of measurements, set formulas, and let links lead to pages and copies of files."""
    if page.file.src_uri == CHOOSE:
        markdown = with_links(markdown)
    markdown = re.sub(r"<!-- measured: (.+?) -->", lambda m: measured(m[1].split()), markdown)
    markdown = markdown.replace("<!-- paper -->", paper())
    up = "../" * page.file.src_uri.count("/")
    for path in _outside(markdown):
        markdown = re.sub(rf"\]\((?:\.\./)+{re.escape(path)}\)", f"]({up}source/{path})", markdown)
    return formulas(markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Let tables, formulas and outputs be reached by keyboard, since they scroll where they are wide."""
    for wide in ("<table>", 'display="block">', '<code class="language-console">'):
        html = html.replace(wide, wide.replace(">", ' tabindex="0">'))
    return html


def on_post_page(output: str, **_: Any) -> str:
    """The theme's search has a name for readers of screens."""
    return output.replace(
        'data-md-component="search" role="dialog"',
        'data-md-component="search" role="dialog" aria-label="Search"',
    )


def formulas(markdown: str) -> str:
    """$$…$$ and $…$ as MathML, outside of code."""
    parts = re.split(r"(```.*?```|`[^`\n]*`)", markdown, flags=re.S)
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(
            r"\$\$(.+?)\$\$", lambda m: convert(m[1].strip(), display="block"), parts[i], flags=re.S
        )
        parts[i] = re.sub(r"\$([^$\n]+)\$", lambda m: f"<span>{convert(m[1])}</span>", parts[i])
    return "".join(parts)


def paper() -> str:
    """The committed report on the paper without its title, its figures among those of the site."""
    _, _, text = (PAPER / "report.md").read_text().partition("\n## ")
    return text.partition("\n")[2].replace("\n### ", "\n## ")


@cache
def _run(method: str, name: str) -> tuple[str, str]:
    """How a run of a scene by a method ended, and its error."""
    scene = find_scene(name).with_(duration=END)
    run = simulate(scene, method, np.linspace(0.0, END, 11))
    if run.outcome.name != "COMPLETED":
        return f"{run.outcome.name} at {run.t_end:.2g} s", "–"
    return "completed", f"{measure(scene, run, truth_for(scene))['error']:.1e}"


def measured(methods: list[str]) -> str:
    """A table of the methods on MEASURED over 0.1 s: how each ended, and its largest error."""
    rows = [
        "| method | " + " | ".join(f"`{name}`" for name in MEASURED) + " |",
        "|---|" + "---|" * len(MEASURED),
    ]
    for method in methods:
        LOG.info("measuring %s", method)
        cells = [", ".join(filter("–".__ne__, _run(method, name))) for name in MEASURED]
        rows.append(f"| `{method}` | " + " | ".join(cells) + " |")
    return "\n".join(rows)
