"""SVG elements: lines and groups that move along a timeline, text and arrows."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from mbref.motions.drawing.timeline import Timeline

# Okabe and Ito's colours, distinguishable with every common colour blindness; yellow is left out
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
INK, GREY, PAPER = "#222222", "#8a8a8a", "#ffffff"


class Picture(str):
    """Text of an SVG, which a notebook shows as a picture."""

    def _repr_html_(self) -> str:
        return str(self)


def line(frames: np.ndarray, look: str, timeline: Timeline | None, closed: bool = False) -> str:
    """Return a line, or an outline, through points (k, n, 2), px, in k frames of a timeline."""
    texts = [" ".join(f"{x:.1f},{y:.1f}" for x, y in frame) for frame in frames]
    kind = "polygon" if closed else "polyline"
    return f'<{kind} points="{texts[0]}" {look}>{_animate(timeline, "points", texts)}</{kind}>'


def follow(places: np.ndarray, content: str, timeline: Timeline | None) -> str:
    """Return content drawn about the origin, carried along places (k, 2), px."""
    texts = [f"{x:.1f},{y:.1f}" for x, y in places]
    moving = _animate(timeline, "transform", texts, "animateTransform", ' type="translate"')
    return f'<g transform="translate({texts[0]})">{content}{moving}</g>'


def text(x: float, y: float, words: str, look: str = "", anchor: str = "middle") -> str:
    """Return text at a position, with a halo that keeps it legible over lines."""
    halo = f'stroke="{PAPER}" stroke-width="3" paint-order="stroke" stroke-linejoin="round"'
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {halo} {look}>{svg_text(words)}</text>'


def svg_text(words: str) -> str:
    """Return text escaped for SVG, with unprintable characters replaced."""
    return escape("".join(c if c.isprintable() else "\ufffd" for c in words))


def arrow(start: np.ndarray, end: np.ndarray, colour: str, width: float = 2.2) -> str:
    """Return an arrow between two points (2,), px; a dot if it points along the line of sight."""
    along, length = end - start, float(np.hypot(*(end - start)))
    if length < 1.0:
        return f'<circle cx="{start[0]:.1f}" cy="{start[1]:.1f}" r="3" fill="{colour}"/>'
    d = along / length
    across, base = np.array([-d[1], d[0]]), end - 9 * d
    tip = " ".join(f"{x:.1f},{y:.1f}" for x, y in (end, base + 4.5 * across, base - 4.5 * across))
    shaft = f"M{start[0]:.1f} {start[1]:.1f}L{base[0]:.1f} {base[1]:.1f}"
    return (
        f'<path d="{shaft}" stroke="{colour}" stroke-width="{width:g}" fill="none"/>'
        f'<polygon points="{tip}" fill="{colour}"/>'
    )


def turn(radius: float, sense: float, colour: str, width: float = 2.2) -> str:
    """Return three quarters of a circle about the origin with an arrowhead; anticlockwise where sense > 0."""
    r, flip = radius, 1 if sense < 0 else -1
    head = f"{-r - 5:.1f},{-1 * flip:.1f} {-r + 5:.1f},{-1 * flip:.1f} {-r:.1f},{-9 * flip:.1f}"
    arc = f"M0 {-r * flip:.1f}A{r:g} {r:g} 0 1 {1 if flip > 0 else 0} {-r:.1f} 0"
    return (
        f'<path d="{arc}" stroke="{colour}" stroke-width="{width:g}" fill="none"/>'
        f'<polygon points="{head}" fill="{colour}"/>'
    )


def moving_or_still(moving: Iterable[str], still: Iterable[str]) -> list[str]:
    """Return animated parts, and their substitutes for paper and for readers whose browser suppresses
    animation."""
    style = (
        "<style>.mbref-still{display:none}@media print,(prefers-reduced-motion:reduce)"
        "{.mbref-still{display:inline}.mbref-moving{display:none}}</style>"
    )
    groups = {"mbref-moving": moving, "mbref-still": still}
    return [style, *(f'<g class="{name}">{"".join(parts)}</g>' for name, parts in groups.items())]


def document(width: float, height: float, parts: list[str], title: str) -> str:
    """Return the whole picture on white; screen readers read the title."""
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
            f'width="{width:.0f}" height="{height:.0f}" class="mechanism" role="img" '
            'style="max-width:100%;height:auto" '
            'font-family="system-ui, DejaVu Sans, sans-serif" font-size="13" '
            'stroke-linecap="round" stroke-linejoin="round">',
            f"<title>{svg_text(title)}</title>",
            f'<rect width="{width:.0f}" height="{height:.0f}" fill="{PAPER}"/>',
            *parts,
            "</svg>\n",
        ]
    )


def _animate(timeline: Timeline | None, attribute: str, values: list[str], *tag: str) -> str:
    return "" if timeline is None else timeline.animate(attribute, values, *tag)
