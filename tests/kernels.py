"""Compile the kernels that the tests need, before them: python -m tests.kernels"""

from crosscheck.engines.shared.compiled import run as integrators
from mbref.equations.row_factors import factorise_rows, solve_rows
from mbref.equations.tangent_solutions import compute_tangents
from mbref.kernels.compilation import prepare_all
from mbref.method import Method
from mbref.stabilisation.all_coordinates import rates_and_balance
from mbref.stepping.preparation import kernels_of
from mbref.taylor.driven import follow_drivers
from mbref.taylor.preparation import kernels_of_series

TANGENTS = (compute_tangents, factorise_rows, solve_rows)
METHODS = (
    "alf-dual+projection",
    "mpi-svd+partitioning",
    "lm1+none/rk4",
    "lm2+projection/adams",
    "alf+none",
    "mpi-gs+none",
    "mpi-gs-literal+none",
    "mpi-qr+none",
)


def prepare(backwards: bool = False) -> None:
    """Compile or load kernels of METHODS and the series. Processes from both ends share the work."""
    general = dict.fromkeys(kernel for name in METHODS for kernel in kernels_of(Method.parse(name)))
    # rates_and_balance: runs by a sparse formulation with redundant rows, without projection
    kernels = [*general, *kernels_of_series(), follow_drivers, rates_and_balance, *TANGENTS]
    prepare_all(kernels[::-1] if backwards else kernels)


if __name__ == "__main__":
    integrators.prepare()  # of engines in compiled families, which each process that runs one needs
    prepare()
