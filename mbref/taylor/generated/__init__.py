"""Optional generated code: the functions of a Taylor method as machine code of one scene, without loops.

Kernels call this code by address (``mbref.taylor.generated_calls``).  Nothing imports it before it is asked
for, and without it every run takes the general kernels.
"""
