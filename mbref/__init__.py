"""mbref: reference implementation of the constraint-handling methods of multibody dynamics."""

__version__ = "0.1.0"
