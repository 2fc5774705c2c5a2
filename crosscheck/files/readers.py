"""The readers of a format that are installed here or in an environment of the cache folder."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.engines.loaders import PLACES, loader
from crosscheck.engines.loaders.loader import Loader
from crosscheck.files.reading import Reader
from crosscheck.versions.environment import Requirement, environment, existing
from mbref.scene.fields import meant as likely


class UnknownReader(Exception):
    """A name that is no reader's; the message lists the known ones, or says why none can be loaded."""


def found_readers(
    names: Sequence[str], form: str, install: bool
) -> tuple[list[Reader], list[tuple[str, str]]]:
    """Return the readers of a format, and (name, reason) of those that are left out.

    ``names`` are readers, each with ``==VERSION`` if another version than the tested one is wanted; without
    names all. With ``install`` missing packages are installed into environments in the cache folder. Raises
    UnknownReader, NotInstalled.
    """
    readers, left_out = list[Reader](), list[tuple[str, str]]()
    for word in names or PLACES:
        name, _, version = word.partition("==")
        of_name = _loaded(name)
        if form not in of_name.formats:
            left_out.append((name, f"reads no {form}"))
            continue
        if (own := of_name.installed()) and version in ("", own):
            readers.append(Reader(name))
            continue
        wanted = _requirement(of_name, version)
        python = environment(wanted) if install else existing(wanted)
        if python is None:
            left_out.append((name, f"{wanted} is not installed"))
        else:
            readers.append(Reader(name, python))
    return readers, left_out


def _loaded(name: str) -> Loader:
    if name not in PLACES and ":" not in name:
        known = ", ".join(PLACES)
        raise UnknownReader(f"unknown reader {name!r}; known: {known}{likely(name, list(PLACES))}")
    try:
        return loader(name)
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise UnknownReader(f"reader {name!r} cannot be loaded: {error}") from None


def _requirement(of_name: Loader, version: str) -> Requirement:
    return Requirement(of_name.package, version or of_name.version, tuple(of_name.beside))
