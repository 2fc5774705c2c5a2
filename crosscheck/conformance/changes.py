"""Changed copies of the items of a scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from mbref.scene_fields import Entry

Item = TypeVar("Item", bound=Entry)


def mapped(item: Item, fields: Mapping[str, Callable[[Any], Any]]) -> Item:
    """A validated copy of a body, joint, driver or load with the named fields mapped, where it has them."""
    given = fields_of(item)
    changed = {n: _plain(f(given[n])) for n, f in fields.items() if given.get(n) is not None}
    return type(item)(**{**given, **changed})


def replaced(item: Item, **fields: Any) -> Item:
    """A validated copy with some fields replaced."""
    return type(item)(**{**fields_of(item), **{name: _plain(value) for name, value in fields.items()}})


def fields_of(item: Entry) -> dict[str, Any]:
    """The fields of an item by name."""
    return {name: getattr(item, name) for name in type(item).model_fields}


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value
