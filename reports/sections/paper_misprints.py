"""Section: misprints of the paper, and statements that its own tables contradict."""

from __future__ import annotations

from crosscheck.paper.cells import COUNTS_III, COUNTS_IV

from ..blocks import Block, Heading, Table

MISPRINTS = (
    ("Eq. 16", "h from t^i to t^(i-1)", "from t^(i-1) to t^i: the estimate goes forwards"),
    (
        "Eq. 19",
        "Φ_q q̈_i in the load's second term",
        "the velocity violation Φ_q q' − ν: the dimensions of a velocity times 2 ω μ",
    ),
    (
        "Eq. 19",
        "ω² Φ_q in the third term",
        "ω² Φ, which is a vector like the other terms; β is mentioned in the text and not used",
    ),
    ("Sect. 4.1", "q̈ of the unconstrained system is M⁻¹ q", "M⁻¹ g, with g of Eq. 5"),
    ("Eq. 27", "U is m × n and square", "U is m × m, S is m × n"),
    (
        "Eqs. 29, 30",
        "R is n × n and has an inverse",
        "only where all n columns of D are independent: with free coordinates and m < n they are not; "
        "mpi-gs takes rows and any rank, mpi-gs-literal is as printed",
    ),
    (
        "Table III",
        "Table III: ALF takes 36.84 s for a second of motion, exactly as LM2 with partitioning",
        "ALF needs 3286 steps for a second and LM2 with partitioning 103, so equal times are impossible: one "
        "number is probably a copy",
    ),
)


def render() -> list[Block]:
    """Return two tables: misprints, and statements that contradict numbers of the tables."""
    return [
        Heading("Misprints found"),
        Table(
            "Misprints of the paper, and how this project reads them.",
            ("Place", "Printed", "Read as"),
            MISPRINTS,
        ),
        Table(
            "Sentences of the paper, and the numbers of its own tables that contradict them.",
            ("Place", "Sentence", "Its tables"),
            _contradictions(),
        ),
    ]


def _contradictions() -> list[tuple[str, str, str]]:
    shares = [COUNTS_IV[name][0] / COUNTS_IV["LM2"][0] for name in COUNTS_IV if name.endswith("CP")]
    svd, gs = COUNTS_III["MPI (SVD)"][1], COUNTS_III["MPI (GS)"][1]
    ratio = COUNTS_III["ALF"][0] / COUNTS_III["ALF + CP"][0]
    return [
        (
            "Sect. 5.1.3",
            "without coordinate partitioning all methods fail after some time",
            "Table III: ALF without partitioning converges",
        ),
        (
            "Sect. 5.1.3",
            "the costs of Gram–Schmidt and SVD do not differ",
            f"Table III: {svd:g} s by SVD, {gs:g} s by Gram–Schmidt, {100 * (gs / svd - 1):.0f} % more",
        ),
        (
            "Sect. 5.1.3",
            "methods with partitioning are cheaper than those without",
            f"Table III: ALF 36.84 s, ALF + CP 48.69 s, with {ratio:.0f} times fewer steps",
        ),
        (
            "Sects. 5.2.2, 6",
            "partitioning lengthens steps by 30 %",
            f"Table IV: by {100 * (1 / max(shares) - 1):.0f} to {100 * (1 / min(shares) - 1):.0f} %",
        ),
    ]
