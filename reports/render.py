"""Writes blocks as one self-contained HTML page, and as Markdown with pictures in files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from mbref import files

from . import figures
from .blocks import (
    Block,
    Cell,
    Figure,
    Heading,
    HeatMap,
    Listing,
    Matrix,
    Moving,
    Opening,
    Plot,
    Record,
    Table,
    Text,
    Verdict,
)

CODE = re.compile("`([^`]+)`")
# characters that Markdown would read as tags, links, emphasis, formulas or entities; an underscore within a
# word and a bracket without an address are text
ACTIVE = re.compile(
    r"[\\`*<~$]|(?<![^\W_])_|_(?![^\W_])|\](?=[(\[:])|(?<=[a-z]):(?=//)|(?<=www)\.|@(?=\w)|&(?=[#\w]+;)"
)
AT_START = re.compile(r"^(#+|[-+>])(?=\s|$)")  # a heading, an item of a list or a quotation
NUMBER = re.compile(r"(?:&lt; )?\d[\d.]*e[-+]?\d+|t = [\d.e-]*\d s|\d[\d.]* (?:ms|µs|s)\b|--[\w-]+")
SHORT_WORD = 8  # letters; a column this narrow keeps the words of its cells whole
TITLE = "Closed-loop mechanisms: engines compared with the true motion"


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
        blocks=[(type(b).__name__.lower(), b) for b in blocks],
        has_opening=any(isinstance(b, Opening) for b in blocks),
        drawn={name: Markup(text) for name, text in drawn.items()},
    )


def markdown(blocks: Iterable[Block], title: str = TITLE) -> str:
    """Return the report as Markdown that shows figures/NAME.svg."""
    return "\n\n".join([f"# {_words(title)}", *map(_markdown, blocks)]) + "\n"


def _markdown(block: Block) -> str:
    match block:
        case Heading():
            return f"{'#' * block.level} {_words(block.text)}"
        case Text():
            return _words(block.text)
        case Table():
            return f"{_words(block.caption)}\n\n{_rows(block)}"
        case Figure():
            picture = f"![{_words(block.name)}](figures/{files.file_name(block.name)}.svg)"
            return f"{_words(block.caption)}\n\n{picture}"
        case Plot():
            return _markdown(block.figure)
        case Opening():
            answers = (f"{label}: {sentence}" for label, sentence in block.sentences.items())
            return "\n\n".join(map(_words, (block.headline, *answers)))
        case Moving():
            return "\n\n".join(
                [_words(block.caption), "\n".join(f"- {_words(title)}" for title, _ in block.panels)]
            )
        case HeatMap():
            rows = [[name, *map(_heat, cells)] for name, cells in block.rows.items()]
            return f"{_words(block.caption)}\n\n{_rows(Table('', [block.label, *block.columns], rows))}"
        case Matrix():
            return f"{_words(block.caption)}\n\n{_matrix(block)}"
        case Record():
            shown = [
                f"{_words(card.settings)}: {card.grade}\n    {_code(card.command)}" for card in block.cards
            ]
            return "\n\n".join([f"### {_words(f'{block.scene}: {block.title}')}", *(f"- {t}" for t in shown)])
        case Listing():
            fence = _ticks(block.text, 3)
            return f"{fence}\n{block.text}\n{fence}"


def _heat(cell: Cell) -> str:
    """Return a cell in Markdown, bold for a wrong motion."""
    return Markup(f"**{_words(cell.text)}**") if cell.kind == "false" else cell.text


def _matrix(matrix: Matrix) -> str:
    """Return the matrix as a table: the engine's best family, then its library's defaults."""
    rows = [
        [
            scene,
            *(
                "; ".join(_verdict(v) for v in matrix.cells[scene].get(name, ()))
                for name, *_ in matrix.engines
            ),
        ]
        for scene, _ in matrix.scenes
    ]
    return _rows(Table("", ["Scene", *(title for _, title, *_ in matrix.engines)], rows))


def _verdict(verdict: Verdict) -> str:
    return f"{verdict.family} {verdict.sign} {verdict.grade}, {', '.join(verdict.lines)}"


def _rows(table: Table) -> str:
    rule = ["---:" if i in table.right else "---" for i in range(len(table.header))]
    return "\n".join(_line(cells) for cells in (table.header, rule, *table.rows))


def _line(cells: Sequence[str]) -> str:
    """Return one line of a Markdown table; cells that are no markup are shown as they are."""
    shown = (str(cell) if isinstance(cell, Markup) else _words(cell) for cell in cells)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in shown) + " |"


def _words(text: str) -> str:
    """Return the text on one line of Markdown that shows it as it is; `code` remains code."""
    parts = CODE.split(" ".join(text.split()))  # in turns text and code
    shown = [_code(part) if k % 2 else ACTIVE.sub(_escaped, part) for k, part in enumerate(parts)]
    return AT_START.sub(lambda start: f"\\{start[0]}", "".join(shown))


def _escaped(found: re.Match[str]) -> str:
    return {"<": "&lt;", "&": "&amp;"}.get(found[0], f"\\{found[0]}")


def _code(text: str) -> str:
    """Return a span of code, between more backticks than the text has in a row."""
    ticks = _ticks(text, 1)
    space = " " * (text[:1] == "`" or text[-1:] == "`")
    return f"{ticks}{space}{text}{space}{ticks}"


def _ticks(text: str, least: int) -> str:
    return "`" * max([least, *(len(run) + 1 for run in re.findall("`+", text))])


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
