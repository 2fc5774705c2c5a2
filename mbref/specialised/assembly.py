"""LLVM IR of a record, in a straight line.

A record becomes a function ``i64 f(double t, double* y, double* angles, double* numbers, double* out,
double* more)`` of the
operations that its results need; it returns 0 when all its guards held.  A sum may take a product in before
it is rounded (``contract``); no other operation is rounded differently from the kernel's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mbref.specialised.tracing import COMPARISONS, Record, Scalar, Untraceable, operand

MOST_OPERATIONS = 20_000  # what LLVM compiles in a second
BINARY = ("fadd", "fsub", "fmul", "fdiv")
VECTORS, RESULTS = ("y", "angles", "numbers"), ("out", "more")
CALLS = {
    "sin": "sin", "cos": "cos", "atan2": "atan2", "sqrt": "llvm.sqrt.f64", "fabs": "llvm.fabs.f64",
    "floor": "llvm.floor.f64",
}  # fmt: skip
SELECTS = {"max": "ogt", "min": "olt"}  # Python's max(a, b) is b only where b > a


@dataclass(frozen=True)
class Piece:
    """A record and which of its scalars, or numbers, are its results: for ``out``, and for ``more``."""

    name: str
    record: Record
    out: Sequence[Scalar | float]
    more: Sequence[Scalar | float] = ()

    def live(self) -> list[int]:
        """Indices of the operations that results and guards need, in order."""
        texts = [operand(value) for value in (*self.out, *self.more)]
        texts += [text for _, *pair in self.record.guards for text in pair]
        live, stack = set(), _indices(texts)
        while stack:
            index = stack.pop()
            if index not in live:
                live.add(index)
                stack += _indices(self.record.operations[index][1:])
        return sorted(live)

    def assembly(self) -> str:
        """The LLVM IR of the function."""
        vectors = ", ".join(f"double* noalias %{name}" for name in (*VECTORS, *RESULTS))
        lines = [f"define i64 @{self.name}(double %t, {vectors}) {{"]
        for index in self.live():
            lines += _instructions(f"%v{index}", *self.record.operations[index])
        held = "true"
        for k, ((comparison, left, right), outcome) in enumerate(self.record.guards.items()):
            lines += [
                f"%c{k} = fcmp {COMPARISONS[comparison]} double {left}, {right}",
                f"%g{k} = xor i1 %c{k}, {'false' if outcome else 'true'}",
                f"%h{k} = and i1 {held}, %g{k}",
            ]
            held = f"%h{k}"
        for vector, values in zip(RESULTS, (self.out, self.more), strict=True):
            for k, value in enumerate(values):
                lines.append(f"%{vector}{k} = getelementptr double, double* %{vector}, i64 {k}")
                lines.append(f"store double {operand(value)}, double* %{vector}{k}")
        lines += [
            f"%failed = xor i1 {held}, true",
            "%status = zext i1 %failed to i64",
            "ret i64 %status",
            "}",
        ]
        return "\n".join(lines)


def _indices(texts: Sequence[str]) -> list[int]:
    return [int(text[2:]) for text in texts if text.startswith("%v")]


def _instructions(result: str, name: str, *operands: str) -> list[str]:
    if name == "t 0":
        return [f"{result} = bitcast double %t to double"]
    vector, _, index = name.partition(" ")
    if vector in VECTORS:
        pointer = f"%i{result[2:]}"
        place = f"{pointer} = getelementptr double, double* %{vector}, i64 {index}"
        return [place, f"{result} = load double, double* {pointer}"]
    if name in BINARY:
        return [f"{result} = {name} contract double {operands[0]}, {operands[1]}"]
    if name == "fneg":
        return [f"{result} = fneg double {operands[0]}"]
    if name in CALLS:
        arguments = ", ".join(f"double {text}" for text in operands)
        return [f"{result} = call double @{CALLS[name]}({arguments})"]
    a, b = operands
    return [
        f"%s{result[2:]} = fcmp {SELECTS[name]} double {b}, {a}",
        f"{result} = select i1 %s{result[2:]}, double {b}, double {a}",
    ]


def text_of(pieces: Sequence[Piece]) -> str:
    """The LLVM IR of the pieces; raises Untraceable where they are too long to compile in a second."""
    length = sum(len(piece.live()) for piece in pieces)
    if length > MOST_OPERATIONS:
        raise Untraceable(f"{length} operations, more than {MOST_OPERATIONS}")
    declarations = [
        f"declare double @{name}(double{', double' if name == 'atan2' else ''})" for name in CALLS.values()
    ]
    return "\n".join([*declarations, *(piece.assembly() for piece in pieces)])
