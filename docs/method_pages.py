"""Pages and tables of the documentation that are made from the formulations' own texts.

``python docs/method_pages.py`` replaces the table of formulations in the guide for choosing.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mbref.formulations import FORMULATIONS, Formulation

BEGIN, END = "<!-- formulations -->", "<!-- /formulations -->"  # around the table of formulations
CHOOSE = "methods.md"  # the pages of formulations follow it in the contents


def page(formulation: Formulation) -> str:
    """Return the page of a formulation: equations, use, limits, and measurements made by the build."""
    name, about = formulation.name, formulation.about
    scene = "four_bar" if formulation.needs_independent_columns else "planar_slider_crank"
    return f"""# `{name}`: {about.title}

**Use it for**: {about.use}

**It fails on**: {about.fails}

```sh
mbref run {scene} --method {name}+projection
```

$${about.formula}$$

{about.text}

## Measured

<!-- measured: {name}+projection {name} -->

Each cell gives the outcome of a run of 0.1 s and its largest error, relative to the mechanism's size or
in rad.

![The planar slider-crank](../figures/motion_planar_slider_crank.svg)
"""


def pages() -> dict[str, str]:
    """Return the text of every formulation's page by its path in the documentation."""
    return {f"methods/{name}.md": page(formulation) for name, formulation in FORMULATIONS.items()}


def table(formulations: Iterable[Formulation]) -> str:
    """Return the table of formulations: what each is, does with redundancy and with singular masses."""
    rows = [
        "| formulation | what it is | equations | redundant rows | singular mass matrix |",
        "|---|---|---|---|---|",
    ]
    for f in formulations:
        redundant = "handled" if f.handles_redundancy else "fails"
        if f.needs_independent_columns:
            redundant = "driven mechanisms only"
        masses = "handled" if f.handles_singular_mass else "fails"
        rows.append(f"| `{f.name}` | {f.about.title} | {f.equations} | {redundant} | {masses} |")
    return "\n".join(rows)


def with_table(text: str) -> str:
    """Return the text of the guide with the present table of formulations between its two marks."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"no {BEGIN} … {END}")
    return f"{before}{BEGIN}\n{table(FORMULATIONS.values())}\n{END}{after}"


def with_links(text: str) -> str:
    """Return a text in which a formulation's name at the begin of a row leads to its page of the site."""
    for name in FORMULATIONS:
        text = text.replace(f"\n| `{name}` |", f"\n| [`{name}`](methods/{name}.md) |")
    return text


def with_formulations(contents: Any) -> Any:
    """Return the contents of the site with the pages of the formulations behind the guide for choosing."""
    if isinstance(contents, list):
        found = [with_formulations(entry) for entry in contents]
        places = [
            i for i, entry in enumerate(contents) if isinstance(entry, dict) and CHOOSE in entry.values()
        ]
        for i in places:
            found[i + 1 : i + 1] = [{name: f"methods/{name}.md"} for name in FORMULATIONS]
        return found
    if isinstance(contents, dict):
        return {title: with_formulations(inside) for title, inside in contents.items()}
    return contents


if __name__ == "__main__":
    guide = Path(__file__).with_name(CHOOSE)
    guide.write_text(with_table(guide.read_text()))
