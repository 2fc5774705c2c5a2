"""Named memory: NamedTuples declare the arrays and numbers of kernels; allocation and access follow from the
declaration (schema).

A field of a schema is an array, a record of numbers, a kernel, another schema, or an ``Address``:

    class Rows(NamedTuple):
        phi: Annotated[Vector, "m"]          # m
        limits: Limits                       # a NamedTuple of int and float fields is a record
        step: Annotated[Kernel, STEP]

Kernels write ``rows.phi[i]`` and ``limits.steps += 1``.  In compiled code a schema is one pointer to a table
of addresses, and only the fields that a kernel uses are loaded. Without compilation a schema is the
NamedTuple itself. The table and its arrays must not be moved or freed while kernels run.
"""

from __future__ import annotations

import ctypes
import functools
import typing
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate
from numba.extending import NativeValue, infer_getattr, intrinsic, models, register_model, unbox
from numba.np.numpy_support import from_dtype

from mbref.kernels.aligned import Kind, aligned_zeros
from mbref.kernels.compilation import INDEX_TABLE, INDICES, MATRIX, PLAIN, UNSIGNED, VECTOR
from mbref.kernels.dimensions import Shapes, check_sizes, size_of
from mbref.kernels.records import Numbers, dtype_of, is_record, record, record_type_of

Vector = Annotated[np.ndarray, VECTOR]  # float64 (k,)
Matrix = Annotated[np.ndarray, MATRIX]  # float64 (k, l)
Indices = Annotated[np.ndarray, INDICES]  # int64 (k,)
IndexTable = Annotated[np.ndarray, INDEX_TABLE]  # int64 (k, l)
Unsigned = Annotated[np.ndarray, UNSIGNED]  # uint32 (k,): indices whose sign need not be tested
Kernel = Callable[..., Any]  # annotated with its signature
# address of a packed schema; the schema's ``opener`` gives access to the memory
Address = Annotated[Any, "address"]

WORD, WORDS = ir.IntType(64), 3  # words of a field: address, rows, columns
MOST_SHAPES = 256  # number of schemas whose shapes are cached


class Named(types.Type):
    """The numba type of a packed schema: a pointer to its table."""

    def __init__(self, schema: type):
        self.schema = schema
        super().__init__(name=f"Named({schema.__module__}.{schema.__qualname__})")


@register_model(Named)
class _NamedModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, WORD.as_pointer())


@unbox(Named)
def _unbox_named(kind, value, context):
    attribute = context.pyapi.object_getattr_string(value, "address")
    number = context.pyapi.long_as_longlong(attribute)
    context.pyapi.decref(attribute)
    return NativeValue(context.builder.inttoptr(number, WORD.as_pointer()))


class Field(typing.NamedTuple):
    """One field of a schema: its numba type, its shape as names of dimensions, its first row in the table."""

    name: str
    title: str  # name of the schema and the field
    kind: types.Type
    shape: tuple[str, ...]
    row: int
    schema: type | None  # set for a field that is another schema
    dtype: np.dtype | None  # type of an array's entries, or of a record


@functools.cache
def fields_of(schema: type) -> Mapping[str, Field]:
    """Return the fields of a schema by name, in the order of its table."""
    fields, row = {}, 0
    for name, hint in typing.get_type_hints(schema, include_extras=True).items():
        kind, shape = _kind_of(hint)
        nested, dtype = kind.schema if isinstance(kind, Named) else None, None
        if shape:
            dtype = np.dtype(str(kind.dtype))
        elif isinstance(kind, types.Record):
            dtype = record_type_of(hint)
        fields[name] = Field(name, f"{schema.__name__}.{name}", kind, shape, row, nested, dtype)
        row += table_rows(nested) if nested else 1
    return fields


def table_rows(schema: type) -> int:
    """Return the number of rows of a schema in a table of addresses."""
    return sum(table_rows(field.schema) if field.schema else 1 for field in fields_of(schema).values())


def _kind_of(hint: Any) -> tuple[types.Type, tuple[str, ...]]:
    metadata = getattr(hint, "__metadata__", ())
    if metadata[:1] == ("address",):
        return types.intp, ()
    if metadata and isinstance(metadata[0], types.Array):
        return metadata[0], tuple(map(str, metadata[1:]))
    if metadata:
        return types.FunctionType(metadata[0]), ()
    return (from_dtype(dtype_of(hint)) if is_record(hint) else Named(hint)), ()


def allocate(schema: type, sizes: Mapping[str, int], **given: Any) -> Any:
    """Return the schema with the ``given`` fields, and zeros of the declared shapes for all other fields."""
    names, kinds, makers = _layout(schema, tuple(sizes.items()), frozenset(given))
    arrays = zip(names, aligned_zeros(kinds), strict=True)
    return schema(**given, **dict(arrays), **{name: make() for name, make in makers})


@functools.lru_cache(maxsize=MOST_SHAPES)
def _layout(
    schema: type, sizes: tuple[tuple[str, int], ...], given: frozenset[str]
) -> tuple[list[str], list[Kind], list[tuple[str, Callable[[], Any]]]]:
    """Return names and kinds of the arrays that are not given, and the other fields that are not given, each
    with the function that makes it."""
    names, kinds, makers = [], [], []
    for field, hint in zip(fields_of(schema).values(), _hints(schema), strict=True):
        if field.name in given:
            continue
        if field.dtype is not None and field.shape:
            names.append(field.name)
            kinds.append((tuple(size_of(part, dict(sizes)) for part in field.shape), field.dtype))
        else:
            makers.append((field.name, _maker(field, hint, dict(sizes))))
    return names, kinds, makers


def _maker(field: Field, hint: Any, sizes: Mapping[str, int]) -> Callable[[], Any]:
    """Return the function that makes a field: a schema or a record."""
    if field.schema:
        return functools.partial(allocate, field.schema, sizes)
    return lambda: record(hint())


@functools.cache
def _hints(schema: type) -> tuple[Any, ...]:
    """Return the types of a schema's fields."""
    return tuple(typing.get_type_hints(schema).values())


class Packed:
    """A schema or a record in the form that kernels accept: pass the field ``argument`` to a kernel. The
    object must exist while the kernel runs.

    ``part`` is a schema inside this object that is already packed, which saves time.
    """

    def __init__(self, values: Any, part: Packed | None = None):
        self.values = values
        if isinstance(values, Numbers):
            self.address = _address(values)
        else:
            words, self.shapes = _words(values, part)
            check_sizes(tuple(self.shapes))
            self.table = np.array(words, dtype=np.int64)
            self.address = self.table.ctypes.data
            self._numba_type_ = _kind(type(values))  # numba's dispatcher reads the type of this argument here
        self.argument = values if PLAIN else self


@functools.cache
def _kind(schema: type) -> Named:
    """Return the numba type of a schema, which is cached because making a type takes longer than a call."""
    return Named(schema)


def packed(values: Any, part: Packed | None = None) -> Packed:
    """Return a schema or record packed for kernels; raises TypeError for a field that does not fit its
    declaration."""
    return Packed(values, part)


def _words(values: Any, part: Packed | None = None) -> tuple[list[int], list[Shapes]]:
    """Return the table of a schema with WORDS numbers for each field (address, rows and columns), and the
    shapes of its arrays."""
    if part is not None and values is part.values:
        return part.table.tolist(), part.shapes
    words: list[int] = []
    shapes: list[Shapes] = []
    for field, value in zip(fields_of(type(values)).values(), values, strict=True):
        if field.schema:
            _check_schema(field, value)
            more, others = _words(value, part)
            words += more
            shapes += others
        elif field.shape:
            _check_array(field, value)
            words += (_address(value), value.shape[0], value.shape[-1])
            shapes.append((field.title, field.shape, value.shape))
        else:
            words += (_address_of_other(field, value), 0, 0)
    return words, shapes


def _check_schema(field: Field, value: Any) -> None:
    """Raise TypeError unless a value has the schema that its field declares."""
    if type(value) is not field.schema:
        needed = field.schema.__name__ if field.schema else ""
        raise TypeError(f"{field.title}: needs {needed}, got {type(value).__name__}")


def _check_array(field: Field, value: Any) -> None:
    """Raise TypeError unless an array has the entries and the order that its field declares."""
    fits = isinstance(value, np.ndarray) and value.dtype == field.dtype
    if not (fits and value.ndim == len(field.shape) and value.flags.c_contiguous):
        found = f"{value.dtype} {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
        raise TypeError(f"{field.title}: needs a contiguous {field.kind}, got {found}")


def _address_of_other(field: Field, value: Any) -> int:
    """Return the address of a record, a kernel or a packed schema; 0 if there is no such object."""
    if field.dtype is not None:
        if getattr(value, "dtype", None) != field.dtype:
            raise TypeError(
                f"{field.title}: needs the record that its schema declares, got {type(value).__name__}"
            )
        return _address(value)
    is_nothing = value is None or (PLAIN and isinstance(field.kind, types.FunctionType))
    return 0 if is_nothing else int(value.address)


def _address(values: np.ndarray | Numbers) -> int:
    """Return the address of an array or record; for writable arrays the buffer gives the address faster."""
    if isinstance(values, np.ndarray) and values.size and values.flags.writeable:
        return addressof(first_byte(values))
    return int(values.__array_interface__["data"][0])


addressof, first_byte = ctypes.addressof, ctypes.c_char.from_buffer


@infer_getattr
class _NamedAttributes(AttributeTemplate):
    key = Named

    def generic_resolve(self, kind, name):
        field = fields_of(kind.schema).get(name)
        return field.kind if field is not None else None


@lower_getattr_generic(Named)
def _load_field(context, builder, kind, pointer, name):
    field = fields_of(kind.schema)[name]
    place = builder.gep(pointer, [WORD(WORDS * field.row)])
    if isinstance(field.kind, Named):
        return place
    address = _load(builder, place)
    if isinstance(field.kind, types.Array):
        return _array(context, builder, field.kind, place, address)
    if isinstance(field.kind, types.FunctionType):
        made = cgutils.create_struct_proxy(field.kind)(context, builder)
        made.c_addr = builder.inttoptr(address, made.c_addr.type)
        return made._getvalue()
    if isinstance(field.kind, types.Record):
        return builder.inttoptr(address, context.get_value_type(field.kind))
    return address


def _load(builder, place) -> ir.Value:
    """Return a word of the table, which no kernel changes: LLVM may load it once for a whole loop."""
    word = builder.load(place)
    word.set_metadata("invariant.load", builder.module.add_metadata([]))
    return word


def _array(context, builder, kind, place, address) -> ir.Value:
    rows, columns = (_load(builder, builder.gep(place, [WORD(k)])) for k in (1, 2))
    size = WORD(kind.dtype.bitwidth // 8)
    made = context.make_array(kind)(context, builder)
    context.populate_array(
        made,
        data=builder.inttoptr(address, made.data.type),
        shape=[rows, columns] if kind.ndim == 2 else [columns],
        strides=[builder.mul(columns, size), size] if kind.ndim == 2 else [size],
        itemsize=size,
        meminfo=None,
    )
    return made._getvalue()


def opener(schema: type) -> Callable[[Any], Any]:
    """Return a kernel function that maps an address to the packed schema, or the record, at that address."""
    kind = from_dtype(dtype_of(schema)) if is_record(schema) else Named(schema)

    @intrinsic
    def opened(typingctx, address):
        def generate(context, builder, signature, arguments):
            return builder.inttoptr(arguments[0], context.get_value_type(kind))

        return kind(types.intp), generate

    return _as_it_is if PLAIN else opened


def _as_it_is(memory: Any) -> Any:
    """Return the argument: without compilation an address is the schema itself."""
    return memory.values if isinstance(memory, Packed) else memory
