"""Commands that README and docs print, read from their shell blocks."""

import re
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.transcripts import commands as shown

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


KINDS = ("", "sh", "console", "text")


def commands(page: Path, kinds: Sequence[str] = KINDS) -> Iterator[list[str]]:
    """Yield the words of each command in a page's blocks of some kinds, without comments."""
    for kind, block in re.findall(r"^```(.*?)\n(.*?)^```$", page.read_text(), re.S | re.M):
        if kind not in kinds:
            continue
        lines = shown(block) if kind == "console" else block.replace("\\\n", " ").splitlines()
        for line in lines:
            if line and re.match(r"(mbref|crosscheck|python|pytest) ", line):
                yield shlex.split(line.partition(" | ")[0], comments=True)


FOUND = [(str(page.relative_to(ROOT)), words) for page in PAGES for words in commands(page)]
