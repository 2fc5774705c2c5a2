"""All messages of the packages in a row, collected from their code: python -m tests.messages [FOLDER ...] A
message is a text of at least four words that is no docstring, and no part of another text."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from mbref.command_line import Parser
from tests.meta.imports import parsed

ROOT = Path(__file__).parents[1]
PACKAGES = ("mbref", "crosscheck", "reports")
LEAST_WORDS = 4
MARKUP = re.compile(r"[<{\\]\w+[ />}{]|^\s*(?:int|static|import|from) ")  # pictures, formulas, C, Python


def text_of(node: ast.expr) -> str:
    """Return the text of a string, with {…} for each value that is filled in."""
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "{…}" for part in node.values)
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def messages(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and text of each message of a file."""
    nodes = list(ast.walk(tree))
    skipped = {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
    skipped |= {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.Constant | ast.JoinedStr) and id(node) not in skipped:
            text = text_of(node)
            if len(re.findall(r"[A-Za-z]{2,}", text)) >= LEAST_WORDS and not MARKUP.search(text):
                yield node.lineno, text


def collected() -> Iterator[tuple[str, int, str]]:
    """Yield file, line and text of every message of the packages."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for line, text in messages(parsed(path)):
                yield str(path.relative_to(ROOT)), line, text


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("folders", nargs="*", metavar="FOLDER", help="default: all packages")
    chosen = tuple(parser.parse_args().folders) or PACKAGES
    for place, number, message in collected():
        if place.startswith(chosen):
            print(f"{place}:{number}: {' '.join(message.split())}")
