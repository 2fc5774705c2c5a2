"""Keep the records of a report, to be committed: one compressed file, from which its pages are rendered.

``python -m reports.keep build/reference reports/reference`` packs the records of a folder into another one.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from crosscheck.study.store import MOTION, pack
from mbref.command_line import Parser
from mbref.files import file_name
from mbref.records import rewrite

from .runs import SceneRuns
from .stored import groups


def keep(found: Sequence[SceneRuns], folder: Path) -> None:
    """Pack scenes, truths, and the records of runs without their motions into a folder."""
    with TemporaryDirectory() as place:
        (Path(place) / "scenes").mkdir()
        for group in found:
            group.scene.save(Path(place) / "scenes" / f"{file_name(group.scene.name)}.toml")
        rewrite(Path(place) / "records.jsonl", [run.record for group in found for run in group.runs])
        rewrite(Path(place) / "truths.jsonl", [group.truth for group in found if group.truth])
        pack(Path(place), folder, MOTION)


def keep_beside(source: Path, folder: Path) -> None:
    """Pack the runs of a report without their motions into a folder, beside its records of other scenes."""
    new = groups(source)
    names = {group.scene.name for group in new}
    keep([*new, *(old for old in groups(folder) if old.scene.name not in names)], folder)


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("source", type=Path, help="folder of the records")
    parser.add_argument("folder", type=Path, help="folder of the compressed file")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--without-motions", action="store_true", help="leave out the motions of runs")
    how.add_argument("--beside", action="store_true", help="the same, and keep the folder's other scenes")
    options = parser.parse_args()
    if options.beside:
        keep_beside(options.source, options.folder)
    else:
        pack(options.source, options.folder, MOTION if options.without_motions else ())
