"""Writes blocks as one self-contained HTML page, and as Markdown with pictures in files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from mbref import files

from . import figures
from .blocks import Block, Figure, Fold, Heading, Opening, Plot
from .markdown import CODE, TITLE, markdown

NUMBER = re.compile(r"(?:&lt; )?\d[\d.]*e[-+]?\d+|t = [\d.e-]*\d s|\d[\d.]* (?:ms|µs|s)\b|--[\w-]+")
SHORT_WORD = 8  # letters; a column this narrow keeps the words of its cells whole


def write(blocks: Sequence[Block], out: Path, title: str = TITLE) -> None:
    """Write ``out``/index.html, ``out``/report.md and ``out``/figures/NAME.svg and .png."""
    pictures = out / "figures"
    pictures.mkdir(parents=True, exist_ok=True)
    drawn: dict[str, str] = {}
    for block in blocks:
        figure = block.figure if isinstance(block, Plot) else block
        if isinstance(figure, Figure):
            drawing = figure.draw()
            drawn[figure.name] = figures.svg(drawing, figure.name)
            name = files.file_name(figure.name)
            files.write(pictures / f"{name}.svg", drawn[figure.name])
            files.write(pictures / f"{name}.png", figures.png(drawing))
    files.write(out / "index.html", html(blocks, drawn, title))
    files.write(out / "report.md", markdown(blocks, title))


def html(blocks: Sequence[Block], drawn: dict[str, str], title: str = TITLE) -> str:
    """Return the HTML page; ``drawn`` maps the name of every figure to its SVG element."""
    environment = Environment(
        loader=PackageLoader(__package__),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"slug": slug, "numbers": numbers, "breakable": breakable, "classes": classes}
    return environment.get_template("page.html").render(
        title=title,
        chapters=[b.text for b in blocks if isinstance(b, Heading) and b.level == 2],
        blocks=list(_parts(blocks)),
        has_opening=any(isinstance(b, Opening) for b in blocks),
        drawn={name: Markup(text) for name, text in drawn.items()},
    )


def _parts(blocks: Sequence[Block]) -> Iterator[tuple[str, Any]]:
    """Yield kind and block of each part of the page; a Fold begins and ends around its blocks."""
    for block in blocks:
        if isinstance(block, Fold):
            yield from (("open", block), *_parts(block.blocks), ("close", block))
        else:
            yield type(block).__name__.lower(), block


def numbers(text: str) -> Markup:
    """Return the text for the page: numbers and options are not broken, commands are set as code."""
    unbroken = NUMBER.sub(r'<span class="nb">\g<0></span>', str(escape(text)))
    return Markup(CODE.sub(r"<code>\1</code>", unbroken))


def classes(cell: str, is_right: bool) -> str:
    """Return the style classes of a table's cell; a cell of short words is broken between words only."""
    long, short = ("right long", "right") if is_right else ("", "short")
    whole = "whole" if all(len(word) <= SHORT_WORD for word in cell.split()) else ""
    return f"{long if len(cell) > (12 if is_right else 27) else short} {whole}".strip()


def breakable(name: str) -> Markup:
    """Return a name for the page that may be broken after underscores and plus signs."""
    return escape(name).replace("_", Markup("_<wbr>")).replace("+", Markup("+<wbr>"))


def slug(text: str) -> str:
    """Return a heading's id in the page."""
    return re.sub(r"\W+", "-", text.lower()).strip("-")
