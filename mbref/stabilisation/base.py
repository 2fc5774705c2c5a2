"""Stabilisation: what the integrator sees of the state, and what is done about constraint violation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from mbref.kernels.compilation import Exchangeable


@dataclass(frozen=True)
class Stabilisation:
    """Feedback in γ and a chart: kernels between the state and the vector that is integrated.

    ``enter(t, y, …) -> length of y`` chooses y from the state in ``work[STATE]``;
    ``rates(accelerate, t, y, y', …) -> status`` evaluates y' and leaves the state in ``work[STATE]``;
    ``accept(t, y, …) -> status`` corrects y after an accepted step (CHANGED: new coordinates, new length);
    ``observe`` is ``rates`` where a sample is taken: it leaves accelerations and multipliers as well.
    ``careful`` is ``rates`` where these return HANDOVER.
    """

    name: str
    source: str  # equations of the paper, or the reference
    enter: Exchangeable
    rates: Exchangeable
    observe: Exchangeable
    careful: Exchangeable
    accept: Exchangeable
    options: Mapping[str, float] = field(default_factory=dict)
    feedback: Callable[[Mapping[str, float]], tuple[float, float]] | None = None  # gains of Φ' and Φ in γ
    largest_turn: float = 1.0  # rad that a body may turn in an adaptive step unless the user says
