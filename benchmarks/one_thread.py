"""One BLAS thread: imported before NumPy, because a second thread that waits is charged to the process."""

import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
