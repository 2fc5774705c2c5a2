"""Checks of the prose in README, CHANGELOG and docs, by proselint with the rules of prose.toml. python -m
tests.prose [FILE ...]"""

import re
import sys
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

from mbref.command_line import Parser

ROOT = Path(__file__).parents[1]
RULES = tomllib.loads((Path(__file__).parent / "prose.toml").read_text())
CODE = re.compile(
    r"^```.*?^```$|``.*?``|`[^`\n]*`|\$\$.*?\$\$|\$[^$\n]*\$|<!--.*?-->|(?<=\])\([^)\s]*\)", re.S | re.M
)
BREAKS = re.compile(r"\n\s*\n|\n(?=\s*(?:[-*>|#]|\d+\.) )|(?<=[.!?:;])\s+|\|")  # between sentences or cells
WORD = re.compile(r"[^\W\d_][\w'’-]*")


def pages() -> list[Path]:
    """Return the files whose prose is checked; pages made from data are left out."""
    docs = (ROOT / "docs").rglob("*.md")
    made = {"findings.md", "conformance.md"}
    others = sorted(path for path in docs if path.name not in made)
    return [ROOT / "README.md", ROOT / "CHANGELOG.md", *others]


def prose(text: str) -> str:
    """Blank out code, formulas and addresses; lines and columns stay."""
    return CODE.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)


def long_sentences(text: str) -> Iterator[tuple[int, str]]:
    """Yield line and message of each sentence with more words than allowed."""
    start = 0
    for gap in [*BREAKS.finditer(text), None]:
        end = gap.start() if gap else len(text)
        sentence = text[start:end]
        if (count := len(WORD.findall(sentence))) > RULES["longest_sentence"]:
            line = text.count("\n", 0, start + len(sentence) - len(sentence.lstrip())) + 1
            yield line, f"{count} words in a sentence: {' '.join(sentence.split())[:60]} …"
        start = gap.end() if gap else end


def linted(text: str) -> Iterator[tuple[int, str]]:
    """Yield line and message of each place that a rule of proselint or of prose.toml names."""
    from proselint.checks import __register__
    from proselint.registry import CheckRegistry
    from proselint.registry.checks import Check, types
    from proselint.tools import LintFile

    registry = CheckRegistry()
    if not registry.checks:
        registry.register_many(__register__)
        ours = types.PreferredFormsSimple(items=RULES["instead"])
        registry.register(Check(check_type=ours, path="plain", message="Write '{}', not '{}'."))
    checks = {name: True for name in [*RULES["checks"], "plain"]}
    for found in LintFile("text", text).lint({"max_errors": 1000, "checks": checks}):
        start = max(found.check_result.span[0] - 1, 0)  # the linter puts a line end before the text
        yield text.count("\n", 0, start) + 1, found.check_result.message


def faults(text: str) -> list[tuple[int, str]]:
    """Return line and message of every fault of a text, in the order of lines."""
    bare = prose(text)
    return sorted([*linted(bare), *long_sentences(bare)])


def main(files: Sequence[Path]) -> int:
    """Print the faults of the files; return 1 if there are any."""
    paths = files or pages()
    lines = [f"{path}:{line}: {message}" for path in paths for line, message in faults(path.read_text())]
    print("\n".join(lines) or f"{len(paths)} files: no fault")
    return 1 if lines else 0


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="default: all pages")
    sys.exit(main(parser.parse_args().files))
