"""The table of checks and the defects that prove them, written by ``python -m tests.zoo.table
docs/results/conformance.md``, and the same as data for reports."""

from collections import Counter
from pathlib import Path

from crosscheck.conformance import suite
from crosscheck.conformance.suite import Verdict, abouts
from mbref.command_line import Parser
from reports.blocks import Fold, Table
from reports.markdown import body
from tests.zoo.defects import DEFECTS

FOR_REPORTS = Path(suite.__file__).with_name("proved_by.toml")
HEADER = ("check", "what it checks", "defects")
HEAD = f"""# Conformance checks

This page lists the checks of the conformance suite, for readers of a verdict by
`crosscheck verify ENGINE`. [Verify your engine](../verify-your-engine.md) explains how to run it. A check
passes, fails, or does not apply, with a reason. The number of a check increases when the check changes, so
that verdicts of different versions are never compared.

Each check has been tested with defects: {len(DEFECTS)} changes of one line, planted one at a time in
`examples/spatial_engine` (`tests/zoo/defects.toml`), or in four linear solvers of that engine
(`tests/zoo/ways.py`). With a defect the check in its row fails on the scene in its row, and passes without it
(`pytest -m "slow or not slow" tests/zoo`). This page is written by
`python -m tests.zoo.table docs/results/conformance.md`.
"""


def page() -> str:
    """The whole page."""
    counts = Counter(defect.check for defect in DEFECTS.values())
    checks = [(Verdict(n, "", "").check(), about, str(counts[n])) for n, about in abouts().items()]
    defects = [(defect.about, defect.scene, defect.check) for defect in DEFECTS.values()]
    header = ("defect", "scene", "check that fails")
    made = [
        Table("Each check, and the number of defects that it detects.", HEADER, checks, frozenset({2})),
        Fold(
            f"The {len(defects)} defects", "defects", [Table("One change of a line each.", header, defects)]
        ),
    ]
    return f"{HEAD}\n{body(made)}\n"


def data() -> str:
    """The defects, each with the scene and the check that detects it, as TOML."""
    lines = ("[[defect]]", "about = {about!r}", "scene = {scene!r}", "check = {check!r}", "")
    head = "# Written by `python -m tests.zoo.table docs/results/conformance.md`.\n\n"
    told = (line.format(**defect._asdict()) for defect in DEFECTS.values() for line in lines)
    return head + "\n".join(told)


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("page", type=Path, help="the page that is written")
    parser.parse_args().page.write_text(page())
    FOR_REPORTS.write_text(data())
