"""XML files of robots: read whole or refused in one sentence; elements that a reader does not know."""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

import numpy as np

from mbref.files import content
from mbref.scene import SceneError

DEEPEST = 200  # elements inside each other; robots need about ten, and Python's recursion ends near 1000
NAME = rb"[A-Za-z_][\w.-]*"
PREFIX = re.compile(rb"(?:</?|\s)(" + NAME + rb"):" + NAME + rb"(?=\s|/|>|=)")  # of a tag or an attribute
DECLARED = re.compile(rb"\sxmlns:(" + NAME + rb")\s*=")
PROLOG = rb"\A(?:\xef\xbb\xbf|\s|<\?(?:(?!\?>).)*\?>|<!--(?:(?!-->).)*-->|<!(?!--)[^>\[]*>)*"
ROOT = re.compile(PROLOG + b"<" + NAME, re.DOTALL)  # up to the name of the first element
SHOWN = 6  # names in a sentence
ROUNDED = 1e-9  # relative excess of the largest moment of inertia: the rounding of a flat body's moments


def parsed(path: Path) -> ET.Element:
    """Return the root element of an XML file; raises SceneError for a file that is no XML or is nested too
    deeply, OSError."""
    return parsed_bytes(content(path), str(path))


def parsed_bytes(text: bytes, where: str) -> ET.Element:
    """Return the root element of an XML text; ``where`` begins the sentence of a SceneError.

    Prefixes such as ``drake:`` need no declaration, as in the parsers of engines, which know no namespaces.
    """
    text = _declared(text)
    root: ET.Element | None = None
    deepest = depth = 0
    try:
        for event, element in ET.iterparse(io.BytesIO(text), ("start", "end")):
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            deepest = max(deepest, depth)
    except (ET.ParseError, ValueError, LookupError) as error:  # also unknown or wrong encodings
        raise SceneError([f"{where}: is no XML: {' '.join(str(error).split())}"]) from None
    if root is None:
        raise SceneError([f"{where}: is no XML: it has no element"])
    if deepest > DEEPEST:
        raise SceneError([f"{where}: its elements are nested {deepest} deep; at most {DEEPEST} are read"])
    return root


def _declared(text: bytes) -> bytes:
    """Return an XML text whose first element declares each prefix that no element declares."""
    missing = set(PREFIX.findall(text)) - set(DECLARED.findall(text)) - {b"xml", b"xmlns"}
    given = b"".join(b' xmlns:%b="%b"' % (prefix, prefix) for prefix in sorted(missing))
    return ROOT.sub(lambda begin: begin[0] + given, text, count=1) if missing else text


def unread(root: ET.Element, known: Mapping[str, Collection[str]]) -> Iterator[str]:
    """Return a sentence for each kind of element that is inside an element of ``known`` but is not listed
    there. Tags with a prefix, such as ``x:part``, are counted too."""
    found: dict[str, list[str]] = {}
    for outer in root.iter():
        if outer.tag not in known:
            continue
        article = "an" if outer.tag[0] in "aeiou" else "a"
        name = f"{outer.tag} {outer.get('name')!r}" if outer.get("name") else f"{article} {outer.tag}"
        for element in outer:
            if isinstance(element.tag, str) and element.tag not in known[outer.tag]:
                found.setdefault(element.tag, []).append(name)
    for tag, places in found.items():
        names = list(Counter(places))
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        yield f"<{tag}> of {', '.join(names[:SHOWN])}{more}: is not read"


def inertia_faults(matrix: np.ndarray, link: str, tags: tuple[str, str, str]) -> Iterator[str]:
    """Return a fault for an inertia matrix (3, 3) that no rigid body has; ``tags`` names its diagonal in the
    file.

    The largest principal moment of a body is at most the sum of the other two.
    """
    if not np.isfinite(matrix).all():
        return
    moments = np.linalg.eigvalsh(matrix)
    names = ", ".join(tags)
    shown = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] < -ROUNDED * abs(moments).max():
        yield f"link {link!r}: has a negative principal moment of inertia ({shown} kg m²); correct {names}"
    elif moments[2] > moments[0] + moments[1] + ROUNDED * moments[2]:
        yield (
            f"link {link!r}: no body has the principal moments {shown} kg m², because the largest exceeds "
            f"the sum {moments[0] + moments[1]:.6g} of the other two; correct {names}"
        )
