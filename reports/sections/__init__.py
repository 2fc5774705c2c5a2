"""Sections of the report, one in each file. `render` takes runs and returns blocks; it never simulates."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from ..blocks import Block, Heading, Text
from ..runs import SceneRuns
from ..sections import (
    accelerations,
    conformance,
    convergence,
    crossings,
    energy,
    least_errors,
    mechanism,
    outcomes,
    provenance,
    published,
    reactions,
    records,
    speed,
    summary,
    support,
    verdict,
    violation,
)

Chapter = Callable[[Sequence[SceneRuns]], list[Block]]
Part = Callable[[SceneRuns], list[Block]]

OPENING: Mapping[str, Chapter] = {
    "verdict": verdict.render,
    "least_errors": least_errors.render,
    "summary": summary.render,
    "published": published.render,
}
OF_A_SCENE: Mapping[str, Part] = {
    "mechanism": mechanism.render,
    "speed": speed.render,
    "violation": violation.render,
    "energy": energy.render,
    "accelerations": accelerations.render,
    "reactions": reactions.render,
    "crossings": crossings.render,
    "outcomes": outcomes.render,
}
CLOSING: Mapping[str, Chapter] = {
    "convergence": convergence.render,
    "support": support.render,
    "provenance": provenance.render,
    "records": records.render,
}
CONFORMANCE = "conformance"  # name of the section that is rendered from the verdicts of `crosscheck verify`
NOTHING = "The requested sections have nothing to show for these scenes."
NAMES = (*OPENING, *OF_A_SCENE, CONFORMANCE, *CLOSING)


def blocks(
    groups: Sequence[SceneRuns], names: Collection[str] = NAMES, verified: Sequence[conformance.Verified] = ()
) -> list[Block]:
    """Return the blocks of the named sections: opening chapters, then the chapters of each scene, then
    closing chapters."""
    out = [block for name, render in OPENING.items() if name in names for block in render(groups)]
    parts = [render for name, render in OF_A_SCENE.items() if name in names]
    for group in groups if parts else ():
        out += [Heading(group.scene.name, 2), *(block for part in parts for block in part(group))]
    if CONFORMANCE in names:
        out += conformance.render(verified)
    out += [block for name, render in CLOSING.items() if name in names for block in render(groups)]
    return out or [Text(NOTHING)]
