"""Bars read back from pictures of mechanisms."""

import xml.etree.ElementTree as ET

import numpy as np

from reports.mechanisms import RUN

SVG = "{http://www.w3.org/2000/svg}"
BACKGROUND = 9.0  # px, thickness of the bodies in the motion behind a run


def bars(picture: str, thickness: float = RUN, panel: int = 0) -> list[np.ndarray]:
    """Frames (k, n, 2), px, of the moving bars of a thickness in a panel."""
    shown = ET.fromstring(picture).find(f"{SVG}g").findall(f"{SVG}svg")[panel]
    lines = [n for n in shown.iter(f"{SVG}polyline") if float(n.get("stroke-width", 0)) == thickness]
    values = [line.find(f"{SVG}animate").attrib["values"].split(";") for line in lines]
    return [np.array([[p.split(",") for p in f.split()] for f in v], dtype=float) for v in values]
