"""Writes blocks as Markdown, with pictures in files: reports, and pages of the documentation."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from mbref import files

from .blocks import (
    Block,
    Cell,
    Figure,
    Fold,
    Heading,
    HeatMap,
    Listing,
    Marked,
    Matrix,
    Moving,
    Opening,
    Plot,
    Prose,
    Record,
    Table,
    Text,
    Verdict,
    Within,
)

CODE = re.compile("`([^`]+)`")
# characters that Markdown would read as tags, links, emphasis, formulas or entities; an underscore within a
# word and a bracket without an address are text
ACTIVE = re.compile(
    r"[\\`*<~$]|(?<![^\W_])_|_(?![^\W_])|\](?=[(\[:])|(?<=[a-z]):(?=//)|(?<=www)\.|@(?=\w)|&(?=[#\w]+;)"
)
AT_START = re.compile(r"^(#+|[-+>])(?=\s|$)")  # a heading, an item of a list or a quotation
TITLE = "Closed-loop mechanisms: engines compared with the true motion"


def markdown(blocks: Iterable[Block], title: str = TITLE) -> str:
    """Return the report as Markdown that shows figures/NAME.svg."""
    return f"# {_words(title)}\n\n{body(blocks)}\n"


def body(blocks: Iterable[Block]) -> str:
    """Return blocks as Markdown, without a title."""
    return "\n\n".join(map(_markdown, blocks))


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
        case Listing():
            fence = _ticks(block.text, 3)
            return f"{fence}{block.kind}\n{block.text}\n{fence}"
        case Prose():
            return block.text.strip()
        case Fold():
            inside = "\n\n".join(map(_markdown, block.blocks))
            summary = f"<summary>{_words(block.summary)}</summary>"
            return f'<details markdown="1" id="{block.place}">{summary}\n\n{inside}\n\n</details>'
        case _:
            return _of_comparison(block)


def _of_comparison(block: Opening | Moving | HeatMap | Matrix | Record) -> str:
    """Return a block that only comparisons of runs have."""
    match block:
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


def _heat(cell: Cell) -> str:
    """Return a cell in Markdown, bold for a wrong motion."""
    return Marked(f"**{_words(cell.text)}**") if cell.kind == "false" else cell.text


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
    shown = (_cell(cell) for cell in cells)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in shown) + " |"


def _cell(cell: str) -> str:
    if isinstance(cell, Within):
        return f"[{_words(cell)}]({cell.href})"
    return str(cell) if isinstance(cell, Marked) else _words(cell)


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
