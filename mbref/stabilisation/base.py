"""Interface of stabilisations: which variables are integrated, and how constraint violation is fed back or
corrected."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from mbref.kernels.compilation import Exchangeable
from mbref.kernels.records import NoNumbers


@dataclass(frozen=True)
class Stabilisation:
    """Feedback in γ and a chart: kernels between the state and the vector y that is integrated.

    All kernels of a chart take ``layout.Memory``.  ``enter(t, y, memory) -> length of y`` chooses y from
    ``memory.state``; ``rates(t, y, y', memory) -> status`` evaluates y' and leaves the state in
    ``memory.state``; ``accept(t, y, memory) -> status`` corrects y after an accepted step (CHANGED: new
    coordinates, new length; SINGULAR_AHEAD: the rank has dropped, and the run ends); ``rates_with_outputs``
    is ``rates`` where a sample is taken: it also writes accelerations and multipliers. ``memory`` is the
    schema of the chart's own memory, in ``Memory.chart``.
    """

    name: str
    enter: Exchangeable
    rates: Exchangeable
    rates_with_outputs: Exchangeable
    accept: Exchangeable
    memory: type | None = None
    numbers: type = NoNumbers  # the method's own numbers, a record with their defaults
    feedback: Callable[[Mapping[str, float]], tuple[float, float]] | None = None  # gains of Φ' and Φ in γ
    projects: bool = False  # True if every accepted state satisfies the constraints
    chooses_coordinates: bool = False  # True if Newton's method solves for the other coordinates
    watches_rank: bool = False  # True if a run ends at a singular position
    # rad; largest rotation of a body in an adaptive step unless the user chooses another
    largest_turn: float = 1.0

    @cached_property
    def options(self) -> Mapping[str, float]:
        """Names and defaults of the method's numbers."""
        return self.numbers()._asdict()
