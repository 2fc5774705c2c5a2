"""Steps of Warp's engines recorded once and replayed without Python between the kernels.

Users of MuJoCo Warp and Newton record a step as a CUDA graph. On the processor Warp replays recorded kernels
in C++, which takes a hundredth of the time of a step from Python.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any


def recorded(step: Callable[[], Any]) -> Callable[[], None]:
    """Return a function that takes the step again, on the arrays that ``step`` uses.

    ``step`` is called once, and none of its kernels run: no array changes.
    """
    import warp

    with warp.ScopedCapture(device="cpu") as capture:
        step()
    return partial(warp.capture_launch, capture.graph)
