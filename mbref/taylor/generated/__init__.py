"""Optional generated code: the functions of a Taylor method as machine code for one scene, without loops.

Kernels call this code by address (``mbref.taylor.generated_calls``). Nothing imports this package unless
generated code is requested; otherwise every run uses the general kernels.
"""
