"""Interface of integrators: one step of y' = f(t, y) in the compiled loop, and the choice of its length."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from mbref.input_error import InputError
from mbref.kernels.compilation import Exchangeable


@dataclass(frozen=True)
class Integrator:
    """``step(rates, t, h, y, y', y_new, memory) -> error ratio`` and ``propose`` are kernels.

    ``step`` writes ``y_new``; its result is the estimated local error over the tolerance (a step is accepted
    up to 1; a fixed-step method returns 0), or minus the status of an evaluation that failed.

    ``propose(h, suggested, ratio, y, y', memory) -> next step`` chooses the length of the next attempt after
    the last attempt, of length h, is judged; ``suggested`` is h before sample times limited the step.
    Accepted (ratio from 0 to 1): y and y' are the new state and its rates.  After a rejected attempt y and y'
    are the old state and its rates.  Before the first step h is 0.

    ``schema`` declares the integrator's own memory, in ``Memory.integrator``.  The states since step
    ``clock.restart`` are one smooth piece: at its first step y changed its meaning or jumped.  An option
    ``max_order`` bounds the order, which reaches the kernels as ``control.order``.

    A method without ``step`` has steps of its own (``mbref.taylor``) in place of the compiled loop's.
    """

    name: str
    order: int
    step: Exchangeable | None
    propose: Exchangeable | None
    schema: type
    adaptive: bool
    options: Mapping[str, float] = field(default_factory=dict)
    crosses: Literal["no", "by series"] = "no"  # how the integrator crosses singular positions

    def highest_order(self, options: Mapping[str, float]) -> int:
        """Return the order that the options allow; raises InputError unless ``max_order`` is a whole number
        up to ``order``."""
        wanted = options.get("max_order", self.order)
        if wanted not in range(1, self.order + 1):
            raise InputError(f"{self.name}: max_order must be 1 to {self.order}, got {wanted:g}")
        return int(wanted)
