"""Formulations by name; each file states its equations and claims."""

from mbref.formulations.base import Formulation
from mbref.formulations.lm1 import LM1
from mbref.formulations.mpi_svd import MPI_SVD

FORMULATIONS: dict[str, Formulation] = {f.name: f for f in (LM1, MPI_SVD)}
