"""Which code is generated for a scene, and from which tables / counts worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.machine_code import NoGeneratedCode
from mbref.taylor.generated import build, driven_orders, orders, power_orders
from mbref.taylor.generated.corrections import Correction
from mbref.taylor.generated.driven_orders import DrivenOrders
from mbref.taylor.generated.elimination import ResponseCode
from mbref.taylor.generated.multiplier_orders import MultiplierOrders
from mbref.taylor.generated.power_orders import PowerOrders

WIDTH = 8


def products(levels: list[list[list[tuple[int, int, float]]]]) -> SimpleNamespace:
    """Return tables of products: blocks of eight lanes, each with levels of (lane, left, right, weight)."""
    left, right, weight, start = [], [], [], [0]
    for block in levels:
        for level in block:
            slots = [(0, 0, 0.0)] * WIDTH
            for lane, *term in level:  # type: ignore[misc]
                slots[lane] = tuple(term)  # type: ignore[assignment]
            left += [s[0] for s in slots]
            right += [s[1] for s in slots]
            weight += [s[2] for s in slots]
        start.append(len(weight))
    return SimpleNamespace(
        left=np.array(left), right=np.array(right), weight=np.array(weight), start=np.array(start)
    )


def series_of(tables: Any, nz: int, nr: int, freedoms: int = 1, drivers: int = 0, lanes: int = 16) -> Any:
    return SimpleNamespace(
        options=SimpleNamespace(start_freedoms=freedoms),
        polynomials=SimpleNamespace(
            products=tables,
            given=SimpleNamespace(driver=np.zeros(drivers)),
            torsions=SimpleNamespace(row=np.zeros(0), damping=np.zeros(0)),
            springs=SimpleNamespace(damping=np.zeros(0)),
            slides=SimpleNamespace(damping=np.zeros(0)),
            timed=SimpleNamespace(function=np.zeros(0)),
        ),
        solver=SimpleNamespace(pivot_columns=np.zeros(nz), pivot_rows=np.zeros(nr)),
        series=SimpleNamespace(terms=np.zeros((3, lanes))),
    )


def level(*lanes: int) -> list[Any]:
    return [(lane, 1, 2, 0.5) for lane in lanes]


@pytest.mark.parametrize(
    ("blocks", "nz", "nr", "serves"),
    [
        ([[level(3, 4), level(3), level(0)]], 3, 2, True),  # 2 of a row: 16 + 8 of 24
        ([[level(3, 4), level(3), level(3)]], 3, 2, False),  # 3 of a row: 24 + 8 of 24
        ([[level(5), level(0), level(0), level(0)]], 3, 2, True),  # lane 5 is no row
        ([[level(0)], [level(1), level(1), level(1)]], 9, 2, False),  # 24 + 16 of 32
        ([[level(0)] * 5, [level(1), level(1), level(1)]], 9, 2, True),  # 24 + 16 of 64
    ],
)
def test_scenes_that_power_serves(blocks, nz, nr, serves):
    """Vectors of the rows' products and of the variables, at most as many as products with multipliers."""
    tables = products(blocks)
    assert power_orders.serves(series_of(tables, nz, nr)) is serves
    assert not power_orders.serves(series_of(tables, nz, nr, freedoms=2))
    assert not power_orders.serves(series_of(tables, nz, nr, drivers=1))


def test_rows_in_groups_of_eight():
    """Rows in lanes 2 to 10: one vector for the first eight, three for the last one, one for variables."""
    second = [level(0, 2), level(2), level(2)]
    assert power_orders.serves(series_of(products([[level(2), level(1, 7)], second]), 2, 9))
    assert not power_orders.serves(series_of(products([[level(2)], second]), 2, 9))


def test_forces_that_are_linear_in_the_variables():
    """Nine variables: two vectors, of two levels and of one."""
    source = np.zeros(24, dtype=int)
    weight = np.zeros(24)
    for slot, variable, value in ((0, 3, 2.0), (5, 8, -1.0), (8, 4, 0.5), (8 + 5, 8, -3.0), (16, 0, 7.0)):
        source[slot], weight[slot] = variable, value
    inertia: Any = SimpleNamespace(start=np.array([0, 16, 24]), source=source, weight=weight)
    expected = np.zeros((9, 9))
    expected[0, 3], expected[5, 8], expected[0, 4], expected[8, 0] = 2.0, -4.0, 0.5, 7.0
    assert power_orders.moments_of(inertia, 9).tolist() == expected.tolist()


def test_products_of_each_row():
    """Rows in lanes 6 to 9 of two vectors; a product has the opposite sign on the other side."""
    tables = products(
        [
            [[(6, 1, 2, 0.5), (0, 3, 3, 9.0)], [(6, 4, 5, -2.0), (7, 0, 1, 1.5)]],
            [[(0, 2, 3, 4.0), (2, 1, 1, 8.0)]],
        ]
    )
    assert orders.terms_of_rows(series_of(tables, 6, 4)) == [
        [(1, 2, -0.5), (4, 5, 2.0)],
        [(0, 1, -1.5)],
        [(2, 3, -4.0)],
        [],
    ]


# --- choices ----------------------------------------------------------------------------------------------
def test_addresses_are_put_into_memory(monkeypatch):
    code = SimpleNamespace(address=lambda name: f"address of {name}")
    asked: list[Any] = []
    monkeypatch.setattr(build, "names_of_functions", lambda taylor: ("expand", "close"))
    monkeypatch.setattr(build, "code_of", lambda taylor, names: asked.append(names) or code)

    class Addresses(dict):  # type: ignore[type-arg]
        rank = 0

    taylor = series_of(None, 7, 6)
    taylor.code = Addresses()
    assert build.put_code(taylor) is code and asked == [("expand", "close")]
    assert taylor.code == {"expand": "address of expand", "close": "address of close"}
    assert taylor.code.rank == 6 == build.rank_of_rows(taylor)


def test_scenes_without_code(monkeypatch, tmp_path):
    monkeypatch.setattr(build, "CACHE", tmp_path)
    monkeypatch.setattr(build, "_key", lambda taylor, names: f"key {names}")
    monkeypatch.setattr(build, "code_at", lambda path, write: (path, write()))
    monkeypatch.setattr(build, "write_code", lambda taylor, names: f"code of {names}")
    monkeypatch.setattr(build, "PLAIN", False)
    assert build.code_of(series_of(None, 7, 6, lanes=120), "ab")[1] == "code of ab"  # 1800 vectors
    with pytest.raises(NoGeneratedCode, match="takes 2048 products of vectors, more than 2000"):
        build.code_of(series_of(None, 7, 6, lanes=128), "ab")
    monkeypatch.setattr(build, "MOST_VECTORS", 32)
    taylor = series_of(None, 7, 6, lanes=16)
    monkeypatch.setattr(build, "PLAIN", True)
    with pytest.raises(NoGeneratedCode, match="without the JIT there is no machine code"):
        build.code_of(taylor, "ab")
    monkeypatch.setattr(build, "PLAIN", False)
    path, text = build.code_of(taylor, "ab")
    assert path == tmp_path / "scenes" / "key ab.code" and text == "code of ab"  # 16 · 16 / 8 = 32 vectors
    with pytest.raises(NoGeneratedCode, match="takes 72 products of vectors, more than 32"):
        build.code_of(series_of(None, 7, 6, lanes=24), "ab")
    taylor.polynomials.torsions.row = np.array([-1, -1])
    assert build.code_of(taylor, "ab")[1] == "code of ab"
    taylor.polynomials.torsions.row = np.array([-1, 0])
    with pytest.raises(NoGeneratedCode, match="rows of couplings of angles"):
        build.code_of(taylor, "ab")


@pytest.mark.parametrize(
    ("varies", "power", "nz", "nr", "names"),
    [
        (False, True, 3, 2, ["expand", "expand_by_power", "factorise"]),
        (False, False, 3, 2, ["expand", "factorise"]),
        (True, True, 3, 2, ["factorise"]),
        (False, False, 5, 3, ["expand"]),
    ],
)
def test_functions_of_a_scene(monkeypatch, varies, power, nz, nr, names):
    """Ranks of 2 and 4 and 16 lanes: (4 + 6) 16 / 8 = 20 and (16 + 15) 16 / 8 = 62 vectors, of 20."""
    monkeypatch.setattr(build, "MOST_VECTORS", 20)
    monkeypatch.setattr(build, "varies", lambda polynomials: varies)
    monkeypatch.setattr(power_orders, "serves", lambda taylor: power)
    found = build.names_of_functions(series_of(None, nz, nr))
    assert found == (*names, "violation", "close", "close_rate")


def test_all_that_the_code_depends_on_is_in_its_key():
    def taylor(change: int = -1) -> Any:
        arrays = [np.arange(3.0) + 10 * k + (change == k) for k in range(7)]
        made = series_of(None, 3, 2)
        made.polynomials = SimpleNamespace(
            products=arrays[:1],
            inertia=arrays[1:2],
            rows=arrays[2:4],
            given=SimpleNamespace(driver=arrays[4]),
        )
        made.solver = SimpleNamespace(linear=arrays[5], pivot_columns=arrays[6], pivot_rows=np.zeros(2))
        return made

    key = build._key(taylor(), ("a", "b"))
    others = [build._key(taylor(k), ("a", "b")) for k in range(7)]
    more = [build._key(taylor(), ("a",))]
    two = taylor()
    two.options.start_freedoms = 2
    more.append(build._key(two, ("a", "b")))
    shaped = taylor()
    shaped.solver.linear = shaped.solver.linear.reshape(1, 3)
    more.append(build._key(shaped, ("a", "b")))
    assert len({key, *others, *more}) == 11 and build._key(taylor(), ("a", "b")) == key and len(key) == 32


@pytest.mark.parametrize(
    ("names", "rank", "made"),
    [
        (("expand",), 2, ["expand MultiplierOrders"]),
        (("expand",), 3, ["expand DrivenOrders"]),
        (("expand_by_power",), 2, ["expand_by_power PowerOrders"]),
        (("factorise",), 2, ["factorise ResponseCode 2"]),
        (("expand_by_power", "factorise"), 2, ["expand_by_power PowerOrders", "factorise RowResponseCode 2"]),
    ],
)
def test_parts_of_the_code(monkeypatch, names, rank, made):
    written: list[str] = []

    class Writes:
        def __init__(self, module: Any, name: str, *pointers: Any, counts: Any = None) -> None:
            self.name = name
            written.append(f"begin {name}")

        def end(self) -> None:
            written.append(f"end {self.name}")

    def part(kind: str) -> Any:
        def make(taylor: Any, *given: Any) -> Any:
            *ranks, write = given
            text = " ".join([write.name, kind, *map(str, ranks)])
            return SimpleNamespace(put=lambda: written.append(text))

        return make

    for kind in ("MultiplierOrders", "DrivenOrders", "PowerOrders", "ResponseCode", "RowResponseCode"):
        monkeypatch.setattr(build, kind, part(kind))
    monkeypatch.setattr(build, "Instructions", Writes)
    corrected = lambda taylor, write: SimpleNamespace(  # noqa: E731
        **{
            name: lambda name=name: written.append(f"{write.name} {name}")
            for name in build.corrections.POINTERS
        }
    )
    monkeypatch.setattr(build, "Correction", corrected)
    text = build.write_code(series_of(None, 3, 2, freedoms=3 - rank), names)
    expected = [
        step for name, of in zip(names, made, strict=True) for step in (f"begin {name}", of, f"end {name}")
    ]
    expected += [
        step for n in ("violation", "close", "close_rate") for step in (f"begin {n}", f"{n} {n}", f"end {n}")
    ]
    assert written == expected and text.startswith("; ModuleID")


# --- vectors of variables and of rows ---------------------------------------------------------------------
def written(pointers: int, counts: int = 0) -> Any:
    """Stand-in for the instructions of a function, whose arguments and numbers are their names."""
    return SimpleNamespace(
        pointers=[f"p{k}" for k in range(pointers)],
        counts=[f"n{k}" for k in range(counts)],
        multiplied=lambda whole, factor: f"{factor} {whole}",
        number=lambda pointer, k: f"{pointer}[{k}]",
    )


@pytest.mark.parametrize(
    ("nz", "nr", "variables", "rows"),
    [
        (3, 2, 1, (0, 1)),
        (8, 8, 1, (1, 2)),
        (9, 7, 2, (1, 2)),
        (9, 8, 2, (1, 3)),
        (7, 1, 1, (0, 1)),
        (16, 1, 2, (2, 3)),
    ],
)
def test_no_vector_without_a_variable_or_a_row(nz, nr, variables, rows):
    """Eight lanes a vector: variables first, then rows, both also in a vector that they share."""
    taylor = series_of(None, nz, nr, lanes=24)
    correction = Correction(taylor, written(4))
    response = ResponseCode(taylor, 2, written(8))
    for made in (correction, response):
        assert (made._of_variables, made._of_rows) == (range(variables), range(*rows))
        assert made._lanes == 24 and made._nz == nz
    assert correction._rows == range(nz, nz + nr)
    assert (correction._terms, correction._phi) == ("p0", "p1")
    assert [correction._lanes_of(b) for b in range(2)] == [range(8), range(8, 16)]
    masked = correction._masked(rows[0], np.arange(1.0, 9.0)).tolist()
    assert masked == [k + 1.0 if nz <= 8 * rows[0] + k < nz + nr else 0.0 for k in range(8)]


def test_arguments_of_the_response():
    """Rows and variables are read from memory; rows are places of their first lanes."""
    made = ResponseCode(series_of(None, 3, 2, lanes=24), 2, written(8))
    names = "terms", "tableau", "particular", "null_space", "response", "last"
    assert [getattr(made, f"_{name}") for name in names] == [f"p{k}" for k in range(6)]
    assert made._rows == ["24 p6[0]", "24 p6[1]"] and made._columns == ["p7[0]", "p7[1]", "p7[2]"]
    assert (made._rank, made._nr) == (2, 2)


def test_sizes_of_orders_with_multipliers():
    """Nine variables, four rows and two functions in 16 lanes; the test replaces the products."""
    tables, other = products([[level(7)], [level(1)]]), products([[level(0)], [level(1)], [level(2)]])
    made = MultiplierOrders(series_of(tables, 9, 4, drivers=2), written(7, 1))
    assert made._products is tables and made._slots == 16 and made._lanes == 16
    assert (made._scale, made._growth, made._sums) == ("p4", "p5", "p6")
    assert (made._terms, made._response, made._left, made._right, made._last) == (
        "p0",
        "p1",
        "p2",
        "p3",
        "n0",
    )
    assert (made._equations, made._functions, made._vectors) == (13, range(13, 15), range(2))
    assert made._weights.tolist() == tables.weight.reshape(2, 8).tolist() and made._first == {}
    made = MultiplierOrders(series_of(tables, 9, 4, drivers=2), written(7, 1), other)
    assert made._products is other and made._slots == 24


def test_sizes_of_orders_by_power():
    """Nine variables and two rows: a vector of row products, then two of v_k and w_k."""
    tables = products([[[(0, 1, 2, 0.5)]], [[(1, 1, 2, 0.5), (2, 3, 4, 0.25)], [(2, 5, 6, -1.0)]]])
    taylor = series_of(tables, 9, 2)
    mass = np.arange(9 * 16.0).reshape(9, 16)
    inertia = {"force": np.arange(16.0), "mass": mass, "source": np.zeros(16, int)}
    for moment in (0.0, 3.0):
        weight = np.append(np.zeros(15), moment)
        weight[[8, 15]] = moment, 0.0
        taylor.polynomials.inertia = SimpleNamespace(**inertia, weight=weight, start=np.array([0, 8, 16]))
        made = PowerOrders(taylor, written(5, 1))
        assert made._power == range(16, 32, 8) and made._slots == 32 and made._sums == "p4"
        assert made._vectors == range(2) and (made._nz, made._nr) == (9, 2)
        assert made._mass.tolist() == mass[:, :9].tolist() and made._has_moments is (moment != 0.0)
        assert made._moments[8, 0] == moment and np.count_nonzero(made._moments) == (moment != 0.0)
        assert [[c.constant for c in v.constant] for v in made._force] == [[*range(8)], [*range(8, 16)]]
    assert made._products.weight[:2].tolist() == [-0.5, -0.25] and made._products.start.tolist() == [0, 16]
    assert made._products.weight[9] == 1.0 and np.count_nonzero(made._products.weight) == 3


def test_lanes_of_driven_orders(monkeypatch):
    """Nine lanes of two rows need two vectors, of which seven lanes are unused."""
    term = (1, 2, 0.5)
    monkeypatch.setattr(driven_orders, "terms_of_rows", lambda taylor: "terms")
    monkeypatch.setattr(
        driven_orders, "_lanes_of", lambda terms: [(k % 2, [term] * (1 + (k == 0))) for k in range(9)]
    )
    made = DrivenOrders(series_of(None, 9, 4, drivers=1), written(7, 1))
    assert made._rows == [0, 1] * 4 + [0] and made._nz == 9
    assert made._products.start.tolist() == [0, 16, 24] and made._slots == 24
    assert np.flatnonzero(made._products.weight).tolist() == [*range(9), 16]


def test_sums_of_eight_slots_are_found_in_one_loop():
    """Ten slots: sums of both orders and the other factors of eight, then of two."""
    made, asked = MultiplierOrders.__new__(MultiplierOrders), []
    made._write = SimpleNamespace(  # type: ignore[assignment]
        repeat=lambda first, k, begun, body: asked.append((first, k, begun[-1], len(begun))) or begun,
        total=lambda parts: [str(part)[-4:] for part in parts],
        product=lambda one, other: f"{one} {other}",
    )
    factors: Any = {c: orders.Factors(f"l{c}", f"r{c}", f"w{c}") for c in range(0, 80, 8)}
    sums, ahead = made._inner("k", factors)  # type: ignore[arg-type]
    assert asked == [(1, "k", "r56", 24), (1, "k", "r72", 6)] and list(sums) == list(factors)
    assert all(number.constant == 0.0 for each in sums.values() for number in each.constant)
    assert [each[1] for each in ahead.values()] == [f"w{c} r{c}"[-4:] for c in factors]
