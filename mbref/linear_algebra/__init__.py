"""Dense and sparse factorisations for the kernels; nothing here depends on mechanisms."""
