"""Symbolic factorisation of S = D Dᵀ: the positions of all numbers of D, S and its Cholesky factor L.

The factorisation is made once for each scene. A body with many joints may be split into copies
(``linear_algebra.hubs``), if that makes fewer updates. SuperLU determines the order of elimination and the
fill (multiple minimum degree on the symmetric pattern). This module adds the lists of products for the
kernels of ``sparse_cholesky``. Indices are unsigned, because compiled code tests the sign of signed indices.
"""

from __future__ import annotations

import functools
import hashlib

import numpy as np

from mbref.input_error import InputError
from mbref.kernels import checked_file
from mbref.kernels.compilation import CACHE
from mbref.kernels.layout import LINK, SparseFactor, Symbolic
from mbref.kernels.named_memory import allocate
from mbref.linear_algebra.hubs import Pattern, least_updates, split_hubs

MOST_PATTERNS = 64  # number of cached patterns
MOST_STORED = 2**25  # bytes of a pattern in a file; a larger one is made in each process
WORTH_SPLITTING = 0.7  # updates with copies / without, below which copies repay their additional rows
MOST_UPDATES = 20_000_000  # of a factorisation; making the list of one takes about 100 bytes


def symbolic_factorisation(
    row: np.ndarray,
    column: np.ndarray,
    entry: np.ndarray,
    active: np.ndarray,
    of_body: int = 0,
    few: bool = False,
) -> Symbolic:
    """Return the symbolic factorisation of a pattern: row, column and place (k,) of each number of D.

    Places are indices into the flat constraint Jacobian; ``active`` (n,) selects the columns. If ``of_body``
    columns belong to a body each, bodies may be split into copies, many or ``few``. Scenes of one structure
    share the arrays of their pattern, which are never changed. Raises InputError for a pattern that is too
    large.
    """
    indices = (np.asarray(array, dtype=np.int64).tobytes() for array in (row, column, entry))
    return _of_pattern(*indices, np.asarray(active, dtype=bool).tobytes(), bytes((of_body, few)))


@functools.lru_cache(maxsize=MOST_PATTERNS)
def _of_pattern(*pattern: bytes) -> Symbolic:
    """Return the symbolic factorisation of a pattern given by arrays as bytes; the result is also cached on
    disk."""
    digest = hashlib.sha256(b"".join(len(part).to_bytes(8, "little") + part for part in pattern))
    path = CACHE / "patterns" / digest.hexdigest()[:32]
    data = checked_file.read(path)
    if data is None:
        symbolic = _unchangeable(_made(*pattern))
        sizes = np.array([array.size for array in symbolic], dtype=np.int64)
        if 4 * sizes.sum() <= MOST_STORED:
            checked_file.write(path, sizes.tobytes() + b"".join(array.tobytes() for array in symbolic))
        return symbolic
    count = len(Symbolic._fields)
    sizes, indices = np.frombuffer(data, np.int64, count), np.frombuffer(data, np.uint32, offset=8 * count)
    return _unchangeable(Symbolic(*np.split(indices.copy(), np.cumsum(sizes)[:-1])))


def _unchangeable(symbolic: Symbolic) -> Symbolic:
    """Return a pattern whose arrays are read-only, so that reused memory of kernels does not restore them."""
    for array in symbolic:
        array.flags.writeable = False
    return symbolic


def _made(*given: bytes) -> Symbolic:
    row, column, entry = (np.frombuffer(indices, dtype=np.int64) for indices in given[:3])
    active = np.frombuffer(given[3], dtype=bool)
    kept, row = np.unique(row, return_inverse=True)
    own = np.flatnonzero(active)
    whole = Pattern(row, np.searchsorted(own, column), entry, own, kept.size)
    pattern, (order, l_start, l_row) = _fewest_updates(whole, *given[4])
    row, column, entry, own, rows = pattern
    if (updates := _count(l_start)) > MOST_UPDATES:
        raise InputError(
            f"the scene is too large: {order.size} constraint rows share bodies, so that their factorisation "
            f"has {updates} updates, at most {MOST_UPDATES} fit; use fewer joints on one body"
        )
    place = np.empty_like(order)
    place[order] = np.arange(order.size)
    row, column, entry = _sorted_by(place[row], column, entry)
    l_key = np.repeat(np.arange(order.size), np.diff(l_start)) * order.size + l_row
    entry_of_s, left, right = _products(row, column, l_key, order.size)
    panel = _panels(l_start, l_row)
    of_system = np.append(kept, np.full(rows - kept.size, LINK))
    return Symbolic(
        row=unsigned(of_system[order]),
        column=unsigned(own),
        link=unsigned(np.flatnonzero(of_system[order][row] == LINK)),
        d_start=unsigned(np.searchsorted(row, np.arange(order.size + 1))),
        d_entry=unsigned(entry),
        d_column=unsigned(column),
        s_entry=unsigned(entry_of_s),
        s_left=unsigned(left),
        s_right=unsigned(right),
        l_start=unsigned(l_start),
        l_row=unsigned(l_row),
        panel=unsigned(panel),
        update=unsigned(_updates(panel, l_start, l_row, l_key)),
    )


OrderAndFill = tuple[np.ndarray, np.ndarray, np.ndarray]  # order, first entries and rows of the columns of L


def _fewest_updates(whole: Pattern, of_body: int, few: int) -> tuple[Pattern, OrderAndFill]:
    """Return the pattern, with or without copies of bodies with many rows, that needs fewer updates."""
    parted = split_hubs(whole, of_body, bool(few)) if of_body else None
    if parted is None:
        return whole, _factor_pattern(whole)
    of_parted = _factor_pattern(parted)
    most = WORTH_SPLITTING * least_updates(whole, of_body)
    if _count(of_parted[1]) < most:
        return parted, of_parted
    of_whole = _factor_pattern(whole)
    if _count(of_parted[1]) < WORTH_SPLITTING * _count(of_whole[1]):
        return parted, of_parted
    return whole, of_whole


def _count(l_start: np.ndarray) -> int:
    """Return the number of updates of a factorisation, from the first entries of the columns of L."""
    below = np.diff(l_start) - 1
    return int(np.sum(below * (below + 1) // 2))


def unsigned(indices: np.ndarray | list[int]) -> np.ndarray:
    """Return indices as 32-bit unsigned integers; raises OverflowError if one does not fit."""
    array = np.asarray(indices, dtype=np.int64)
    if (array > np.iinfo(np.uint32).max).any():
        raise OverflowError("the scene is too large for 32-bit indices")
    return array.astype(np.uint32)


def empty_factor() -> SparseFactor:
    """Return memory of a factor without rows."""
    nothing = np.zeros(0, dtype=np.int64)
    return sparse_factor(symbolic_factorisation(nothing, nothing, nothing, nothing))


def sparse_factor(symbolic: Symbolic) -> SparseFactor:
    """Return memory for the factor of this pattern."""
    sizes = {
        "nd": symbolic.d_entry.size, "nl": symbolic.l_row.size, "r": symbolic.row.size,
        "c": symbolic.column.size,
    }  # fmt: skip
    factor = allocate(SparseFactor, sizes, symbolic=symbolic)
    factor.share[:] = 1.0 / np.bincount(symbolic.column)[symbolic.column] if symbolic.column.size else 1.0
    return factor


def system_rows(symbolic: Symbolic) -> np.ndarray:
    """Return the rows of the system in a factorisation, in the order of elimination."""
    return symbolic.row[symbolic.row != LINK].astype(np.int64)


def _factor_pattern(pattern: Pattern) -> OrderAndFill:
    """Return the order of elimination of S = D Dᵀ, and first entries and rows of the columns of its factor.

    SuperLU factorises a matrix of that pattern with a dominant diagonal, so that it does not exchange rows.
    """
    from scipy.sparse import csc_array, csr_array, eye_array  # slow import, avoided by cached patterns
    from scipy.sparse.linalg import splu

    places = pattern.row, pattern.column
    d = csr_array((np.ones(pattern.row.size), places), shape=(pattern.rows, pattern.own.size))
    size = d.shape[0]
    if not size:
        return np.zeros(0, dtype=int), np.zeros(1, dtype=int), np.zeros(0, dtype=int)
    sample = csr_array(
        (np.random.default_rng(1).uniform(0.5, 1.0, d.nnz), d.indices, d.indptr), shape=d.shape
    )
    s = csc_array(sample @ sample.T)
    s = s + eye_array(size, format="csc") * (10.0 * abs(s).sum(axis=0).max())
    factored = splu(
        s, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
    )
    if not np.array_equal(factored.perm_c, factored.perm_r):
        raise AssertionError("the elimination order is not symmetric")
    lower = csc_array(factored.L)
    lower.sort_indices()
    return np.argsort(factored.perm_c), lower.indptr.astype(np.int64), lower.indices.astype(np.int64)


def _sorted_by(key: np.ndarray, *others: np.ndarray) -> list[np.ndarray]:
    order = np.argsort(key, kind="stable")
    return [key[order], *(other[order] for other in others)]


def _products(
    row: np.ndarray, column: np.ndarray, l_key: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return index triples: the place in L of a number of S, and two numbers of D in one column, whose
    product is added to that number. Neighbours are added to different numbers, so that none waits."""
    by_column, pairs = np.argsort(column, kind="stable"), []
    for group in np.split(by_column, np.flatnonzero(np.diff(column[by_column])) + 1):
        first, second = np.tril_indices(group.size)
        pairs.append((group[first], group[second]))
    left, right = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return np.searchsorted(l_key, row[right] * size + row[left]), left, right


def _panels(l_start: np.ndarray, l_row: np.ndarray) -> np.ndarray:
    """Return the first column of each panel, and the number of columns: two neighbours are a panel if the
    first one has an entry in the row of the second one, and no other row more."""
    count = np.diff(l_start)
    follows = l_row[np.minimum(l_start[:-1] + 1, l_row.size - 1)] == np.arange(1, count.size + 1)
    pairs = (follows[:-1] & (count[:-1] == count[1:] + 1)).tolist()
    firsts = [0]
    while firsts[-1] < count.size:
        k = firsts[-1]
        firsts.append(k + 2 if k < len(pairs) and pairs[k] else k + 1)
    return np.array(firsts, dtype=np.int64)


def _updates(panel: np.ndarray, l_start: np.ndarray, l_row: np.ndarray, l_key: np.ndarray) -> np.ndarray:
    """Return the place in L of each pair of rows below a panel: columns of the first row, panel by panel."""
    size, places = l_start.size - 1, [np.zeros(0, dtype=np.int64)]
    for last in panel[1:] - 1:
        below = l_row[l_start[last] + 1 : l_start[last + 1]]
        first, second = np.triu_indices(below.size)
        places.append(np.searchsorted(l_key, below[first] * size + below[second]))
    return np.concatenate(places)
