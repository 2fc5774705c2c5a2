"""`python -m reports.pages [NAME …]`: write pages of the documentation from stored records.

Without names it writes all pages into docs/results of the checkout. With the page on findings it writes a
script for each proof into findings/.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

from mbref.command_line import Parser, status_of
from mbref.files import write

from ..markdown import body

NAMES = (
    *("which-engine", "closed-loops", "convergence", "invariants", "alternatives", "small-motions"),
    *("derivatives", "files", "real-files"),
    *("findings", "support", "thresholds"),
)
TEMPLATES = Path(__file__).parents[1] / "templates"  # texts of the pages, with names of parts in braces
RESULTS = Path(__file__).parents[2] / "docs" / "results"
PROOFS = Path(__file__).parents[2] / "findings"


def text(name: str, records: Path | None = None) -> str:
    """Return a page in Markdown, of a file of records or, by default, of the stored records."""
    page = import_module(f"{__package__}.{name.replace('-', '_')}")
    parts = page.parts(*([] if records is None else [records]))
    made = {name: part if isinstance(part, str) else body(part) for name, part in parts.items()}
    return (TEMPLATES / f"{name}.md").read_text(encoding="utf-8").format(**made)


def proofs() -> Mapping[Path, str]:
    """Return the scripts that prove findings without crosscheck, by their paths."""
    page = import_module(f"{__package__}.findings")
    made = page.scripts((TEMPLATES / "finding.sh").read_text(encoding="utf-8"))
    return {PROOFS / f"{name}.sh": script for name, script in made.items()}


def main(argv: Sequence[str] | None = None) -> int:
    """Write pages; returns 0, or 2 for bad input."""
    return status_of(lambda: _write(argv))


def _write(argv: Sequence[str] | None) -> int:
    parser = Parser(description=__doc__)
    parser.add_argument("name", nargs="*", metavar="NAME", choices=[[], *NAMES], help=", ".join(NAMES))
    parser.add_argument("--records", type=Path, metavar="FILE", help="default: the stored records")
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: docs/results/NAME.md")
    options = parser.parse_args(argv)
    for name in options.name or NAMES:
        path = options.out or RESULTS / f"{name}.md"
        write(path, text(name, options.records))
        print(f"written: {path}", file=sys.stderr)
        if path == RESULTS / "findings.md":
            _write_proofs()
    return 0


def _write_proofs() -> None:
    for path in PROOFS.glob("*.sh"):
        path.unlink()
    for path, script in proofs().items():
        write(path, script)
        path.chmod(0o755)
    print(f"written: {PROOFS}/*.sh", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
