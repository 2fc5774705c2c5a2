"""Formulations by name; each file states its equations and claims."""

from mbref.formulations.alf import ALF
from mbref.formulations.alf_dual import ALF_DUAL
from mbref.formulations.base import Formulation
from mbref.formulations.lm1 import LM1
from mbref.formulations.lm2 import LM2
from mbref.formulations.mpi_gs import MPI_GS
from mbref.formulations.mpi_gs_literal import MPI_GS_LITERAL
from mbref.formulations.mpi_qr import MPI_QR
from mbref.formulations.mpi_svd import MPI_SVD

FORMULATIONS: dict[str, Formulation] = {
    f.name: f
    for f in (
        LM1,
        LM2,
        ALF,
        ALF_DUAL,
        MPI_SVD,
        MPI_GS,
        MPI_GS_LITERAL,
        MPI_QR,
    )
}
