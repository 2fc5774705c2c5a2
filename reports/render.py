"""Blocks as one self-contained HTML page and as Markdown with pictures beside it."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from reports import figures
from reports.blocks import Block, Figure, Heading, Listing, Table, Text

TITLE = "Closed-loop mechanisms: engines against truth"


def write(blocks: Sequence[Block], out: Path) -> None:
    """Write ``out``/index.html, ``out``/report.md and ``out``/figures/NAME.svg and .png."""
    pictures = out / "figures"
    pictures.mkdir(parents=True, exist_ok=True)
    drawn: dict[str, str] = {}
    for block in blocks:
        if isinstance(block, Figure):
            drawing = block.draw()
            drawn[block.name] = figures.svg(drawing, block.name)
            name = file_name(block.name)
            (pictures / f"{name}.svg").write_text(drawn[block.name], encoding="utf-8")
            (pictures / f"{name}.png").write_bytes(figures.png(drawing))
    (out / "index.html").write_text(html(blocks, drawn), encoding="utf-8")
    (out / "report.md").write_text(markdown(blocks), encoding="utf-8")


def html(blocks: Sequence[Block], drawn: dict[str, str]) -> str:
    """The page; ``drawn`` has the SVG element of every figure by name."""
    environment = Environment(
        loader=PackageLoader("reports"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["slug"] = slug
    return environment.get_template("page.html").render(
        title=TITLE,
        chapters=[b.text for b in blocks if isinstance(b, Heading) and b.level == 2],
        blocks=[(type(b).__name__.lower(), b) for b in blocks],
        drawn={name: Markup(text) for name, text in drawn.items()},
    )


def markdown(blocks: Iterable[Block]) -> str:
    """The report as Markdown that shows figures/NAME.png."""
    return "\n\n".join([f"# {TITLE}", *map(_markdown, blocks)]) + "\n"


def _markdown(block: Block) -> str:
    match block:
        case Heading():
            return f"{'#' * block.level} {_words(block.text)}"
        case Text():
            return block.text
        case Table():
            return f"{block.caption}\n\n{_rows(block)}"
        case Figure():
            return f"{block.caption}\n\n![{_words(block.name)}](figures/{file_name(block.name)}.png)"
        case Listing():
            return f"```\n{block.text}\n```"


def _rows(table: Table) -> str:
    rule = ["---:" if i in table.right else "---" for i in range(len(table.header))]
    return "\n".join(_line(cells) for cells in (table.header, rule, *table.rows))


def _line(cells: Sequence[str]) -> str:
    """One line of a Markdown table; what would end a cell or a line is taken out of it."""
    return "| " + " | ".join(_words(cell).replace("|", "\\|") for cell in cells) + " |"


def _words(text: str) -> str:
    """The text on one line, without tags of HTML."""
    return " ".join(text.replace("&", "&amp;").replace("<", "&lt;").split())


def file_name(name: str) -> str:
    """The name of a figure as a file name: a name that is none, such as ../up, gets a number of its own."""
    plain = re.sub(r"[^\w-]+", "-", name).strip("-")[:80]
    return plain if plain and plain == name else f"{plain}-{zlib.crc32(name.encode()):08x}"


def slug(text: str) -> str:
    """A heading as the id of its place in the page."""
    return re.sub(r"\W+", "-", text.lower()).strip("-")
