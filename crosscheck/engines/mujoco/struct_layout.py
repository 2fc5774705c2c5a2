"""Byte offsets of fields in the C structure ``mjData``, from the description of MuJoCo's headers in its
Python package."""

from __future__ import annotations

import ctypes
import functools
from typing import Any

SIMPLE: dict[str, Any] = {
    "int": ctypes.c_int,
    "double": ctypes.c_double,
    "mjtNum": ctypes.c_double,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_size_t,
    "mjtSize": ctypes.c_int64,
    "mjtBool": ctypes.c_bool,
    "mjtByte": ctypes.c_ubyte,
    "float": ctypes.c_float,
    "uint64_t": ctypes.c_uint64,
}


@functools.cache
def _structure(name: str) -> Any:
    """Return the structure as a ctypes class; raises LookupError for an unknown type."""
    from mujoco.introspect import structs

    fields = [(field.name, _type(field.type)) for field in structs.STRUCTS[name].fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _type(kind: Any) -> Any:
    if not (extents := getattr(kind, "extents", ())):
        name = getattr(kind, "name", None)
        if name is None:
            return ctypes.c_void_p
        return SIMPLE[name] if name in SIMPLE else _structure(name)
    found = _type(kind.inner_type)
    for extent in reversed(extents):
        found = found * extent
    return found


def offset(field: str) -> int:
    """Return the number of bytes from the start of mjData to a field."""
    return int(getattr(_structure("mjData"), field).offset)
