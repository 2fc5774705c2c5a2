"""mbref: reference implementation of the constraint-handling methods of multibody dynamics."""
