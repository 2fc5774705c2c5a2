"""Dense and sparse factorisations for the kernels; nothing here knows a mechanism."""
