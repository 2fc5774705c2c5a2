"""The findings as a page: ``python -m crosscheck.findings.document docs/findings.md`` writes it anew."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from crosscheck.findings.finding import FOLDER, Finding, findings
from mbref.command_line import Parser

HEAD = """# Findings

What crosscheck found in other engines, each with a proof that runs again: `crosscheck findings` lists them,
and `crosscheck findings --recheck` asks the installed versions which of them are still there. Scripts need
the engine alone. An error that ends the process is described in words, without a proof. Made by
`python -m crosscheck.findings.document docs/findings.md` from `crosscheck/findings/findings.toml`.
"""


def page() -> str:
    """Return the page in Markdown."""
    return "\n".join([HEAD, *_table(), *(line for found in findings() for line in _entry(found))]) + "\n"


def _table() -> Iterator[str]:
    yield "| finding | engine | version | measured |"
    yield "| --- | --- | --- | --- |"
    for found in findings():
        yield f"| [{found.name}](#{found.name}) | {found.engine} | {found.version} | {_measured(found)} |"
    yield ""


def _measured(found: Finding) -> str:
    if found.crashes:
        return "the process ends"
    number = f"more than {found.wrong_above:.3g}" if math.isnan(found.measured) else f"{found.measured:.3g}"
    return f"{number} {found.unit}".strip()


def _entry(found: Finding) -> Iterator[str]:
    yield f"## {found.name}\n"
    yield f"{found.package} {found.version}. {found.does}\n"
    yield f"Right is: {found.right}\n"
    yield f"{found.cause}\n"
    if found.crashes:
        return
    if found.script:
        yield f"```python\n{found.script.strip()}\n```\n"
    else:
        options = ", ".join(f"{name} {value:g}" for name, value in found.options.items())
        yield f"Scene `{found.scene}` at the setting `{found.family}` ({options}):\n"
        yield f"```toml\n{(FOLDER / found.scene).read_text().strip()}\n```\n"
    yield f"`{found.command()}`\n"


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("page", nargs="?", type=Path, help="default: print the page")
    path = parser.parse_args().page
    if path:
        path.write_text(page())
    else:
        print(page(), end="")
