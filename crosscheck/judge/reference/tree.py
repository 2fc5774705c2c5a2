"""Formulation B of the reference: joint coordinates of a spanning tree, loop closures, d'Alembert's
principle.

At all points of a panel (interval of time) at once, twists and their rates without joint accelerations are
propagated outwards along the tree (tree_joints.py), and the joint accelerations q'' and multipliers λ solve
[M Gᵀ; G 0] (q'', λ) = (Q, γ), with mass matrix M and forces Q of tree_loads.py and the closures' Jacobian G
of tree_closures.py.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from crosscheck.judge.arithmetic import Arithmetic
from crosscheck.judge.deadline import TimeIsUp, ask, within
from crosscheck.judge.reference.motion import Motion, Progress, no_progress
from crosscheck.judge.reference.panels import Panel, Panels
from crosscheck.judge.reference.stiff_panels import StiffPanels
from crosscheck.judge.reference.tree_equations import OPEN, TreeEquations
from crosscheck.judge.reference.vectors import apply, product, unit
from crosscheck.judge.time_functions import NEAR, next_end
from mbref.scene import Scene

NODES_PER_DIGIT = 2.1
FIRST = 0.1  # length of the first panel / duration
LEAST = 1e-10  # shortest panel / duration
SLOW = 20  # Picard iterations; a panel that needs more may be stiff
NEAR_END = 0.7  # fraction of a panel; a singular position after this fraction is too near to the panel's end
BEYOND = (
    0.35  # half lengths: largest distance of a singular position from the end of a panel that steps across it
)
LEAST_LOST = 1e6  # rounding units: larger losses of a step across a singular position cause a second attempt
MOST_LOST = 1e-7  # largest error of a step across a singular position, before closures are corrected
SEVERAL = 3  # failed panels across a singular position before a step across it is tried


def tree_motion(
    scene: Scene,
    times: np.ndarray,
    arithmetic: Arithmetic,
    *,
    seconds: float,
    nodes_per_digit: float = NODES_PER_DIGIT,
    seed: int = 0,
    displaced: float = 0.0,
    progress: Progress = no_progress,
) -> Motion:
    """Return the motion of a scene at increasing times (k,) ≥ 0 in an arithmetic; see Motion.

    Another ``seed`` selects other rows if rows are redundant, and displaces the joints that close loops by up
    to ``displaced``, relative to the scene's length. The motion ends early, with the reason, after
    ``seconds`` of CPU time, if loops open, or if no panel is short enough. ``progress`` receives the time of
    every panel.  Raises SceneError if start velocities violate the joints.
    """
    clock = time.thread_time()
    equations = TreeEquations(scene, arithmetic, (seed, displaced))
    run = _Run(equations, np.asarray(times, dtype=float), nodes_per_digit)
    try:
        with within(seconds):
            reason = run.through(progress)
    except TimeIsUp as end:
        reason = str(end)
    return run.motion(reason, time.thread_time() - clock)


class _Run:
    """Panels from t = 0 on, and the samples inside them."""

    def __init__(self, equations: TreeEquations, times: np.ndarray, nodes_per_digit: float):
        self.equations, self.arithmetic, self.times = equations, equations.arithmetic, times
        self.panels = Panels(self.arithmetic, round(-nodes_per_digit * np.log10(self.arithmetic.eps)))
        self.t = self.arithmetic.number(0.0)
        self.state = self.arithmetic.zeros(0)
        self.samples: list[tuple[np.ndarray, np.ndarray]] = []
        self.crossings: list[float] = []
        self.foreseen = 0.0  # time of the next singular position; after it, of the last singular position
        self.unsettled, self.lost = (
            0,
            np.inf,
        )  # failed panels across the next position; error of a step across it
        self.taken = self.steps = 0
        self.stiff, self.is_stiff = StiffPanels(self.panels), False

    def through(self, progress: Progress) -> str:
        """Run to the last time; return the reason if the motion ends before."""
        ask()
        self.state = self.equations.start()
        if reason := self.equations.undetermined():
            return reason
        end, panel = self.times.max(initial=0.0), None
        length = self.arithmetic.number(FIRST * end or 1.0)
        while self.taken < len(self.times):
            ask()
            self.equations.since = float(self.t)
            panel = self._tried(panel, self._before_end(self._before_singular(length)))
            is_shortened = panel.settled and panel.length < length
            length = length if is_shortened else panel.length * panel.factor
            if not panel.settled or self.foreseen <= float(self.t):
                self.foreseen = panel.time(panel.foreseen) or self.foreseen
            if not panel.settled and length < LEAST * end:
                return "no panel of time is short enough"
            if panel.settled and not self._accepts(panel):
                return (
                    "rows that were redundant at the start are independent later, so the start is a "
                    "singular position"
                )
            progress(float(self.t))
        return ""

    def _before_end(self, length: Any) -> Any:
        """Return a length with which no panel passes the end of a piece of a function of time."""
        left = next_end(self.equations.scene, float(self.t))
        return length if self.t + length <= left else self.arithmetic.number(left) - self.t

    def _tried(self, last: Panel | None, length: Any) -> Panel:
        """Solve a panel of the given length; after several failures, solve a panel across a singular
        position."""
        panel = self._panel(length, self._guess(last, length))
        step_across = None if panel.settled else self._step_across(panel.time(panel.foreseen))
        return step_across or panel

    def _accepts(self, panel: Panel) -> bool:
        """Take the samples and the end state of a converged panel; returns False if a loop is open at its
        end."""
        after = panel.start + panel.length
        state = self.equations.closed(after, panel.states[-1])
        if self.equations.gap(after, state) > OPEN:
            return False
        self._sample(panel)
        self._advance(panel, after, state)
        return True

    def _panel(self, length: Any, guess: np.ndarray) -> Panel:
        """Solve a panel by Picard's iteration, or by Newton's method while decays are short against the
        panel."""
        solver = self.stiff if self.is_stiff else self.panels
        panel = solver.panel(self.equations, self.t, length, guess)
        if self.is_stiff or panel.sweeps >= SLOW:
            self.is_stiff = self.stiff.is_for(self.equations, self.t, float(length), guess[0])
        return panel

    def _before_singular(self, length: Any) -> Any:
        """Return a length with which no panel ends near a singular position.

        A panel ends half a length before the singular position, and the next panel has the position in its
        middle.
        """
        gap = self.foreseen - float(self.t)
        near = NEAR_END * float(length) < gap < (1 + NEAR_END) * float(length)
        return self.arithmetic.number(gap) - length / 2 if near else length

    def _step_across(self, singular: float | None) -> Panel | None:
        """Return a panel across a singular position (s) at which the iteration does not converge.

        A panel that ends before the position is extended by its series; None if shorter panels lose less
        accuracy.
        """
        if singular is None or singular <= self.t:
            return None
        self.unsettled += 1
        if self.unsettled < SEVERAL:
            return None
        length = (self.arithmetic.number(singular) - self.t) / (1 + BEYOND / 2)
        short = self._panel(length, self._guess(None, length))
        if not short.settled:
            return None
        if short.start + short.length * (1 + BEYOND) > next_end(self.equations.scene, float(self.t)):
            return None
        panel, lost = self.panels.continued(short, 1 + BEYOND, singular)
        before, self.lost = self.lost, lost
        if lost > MOST_LOST or LEAST_LOST * self.arithmetic.eps < lost < before:
            return None
        return panel

    def _guess(self, tried: Panel | None, length: Any) -> np.ndarray:
        """Return states at the points of a panel: the present state, or states of a longer panel tried
        before."""
        if tried is None or tried.settled:
            return np.repeat(self.state[None], self.panels.count, axis=0)
        guess, _ = self.panels.sampled(tried, self.t + length / 2 * (self.panels.nodes + 1))
        guess[0] = self.state
        return guess

    def _sample(self, panel: Panel) -> None:
        end = float(panel.start + panel.length)
        ends = end * (1 + NEAR) >= next_end(self.equations.scene, float(panel.start)) and end < self.times[-1]
        stop = int(np.searchsorted(self.times, end, side="left" if ends else "right"))
        if stop > self.taken:
            at = self.arithmetic.array(self.times[self.taken : stop])
            self.samples.append(self.panels.sampled(panel, at))
            self.taken = stop

    def _advance(self, panel: Panel, after: Any, state: np.ndarray) -> None:
        self.t, self.state, self.steps = after, state, self.steps + 1
        if (crossed := panel.time(panel.crossing)) is not None:
            self.crossings.append(crossed)
            self.unsettled, self.lost = 0, np.inf

    def motion(self, reason: str, seconds: float) -> Motion:
        """Return the samples as the motion of the bodies."""
        equations, numbers = self.equations, self.arithmetic
        if not self.samples:
            self.samples.append((numbers.zeros(0, int(equations.ends[-1])), numbers.zeros(0, equations.nv)))
        y, rates = (np.concatenate(parts) for parts in zip(*self.samples, strict=True))
        times = self.times[: self.taken]
        at = equations.at(numbers.array(times), y)
        placed, acceleration = at.placed, rates[:, rates.shape[1] - equations.nv :]
        gained = apply(np.swapaxes(placed.columns, -1, -2), acceleration[:, None])
        given = unit(numbers.array([body.orientation for body in equations.scene.body]))
        return Motion(
            times=times,
            position=placed.position[:, :-1],
            orientation=product(placed.turn[:, :-1], given),
            velocity=placed.velocity[:, :-1],
            angular_velocity=placed.spin[:, :-1],
            acceleration=(placed.drift + gained[..., :3])[:, :-1],
            angular_acceleration=(placed.spin_drift + gained[..., 3:])[:, :-1],
            reached=float(self.times[-1] if self.taken == len(self.times) and self.taken else self.t),
            reason=reason,
            steps=self.steps,
            crossings=tuple(self.crossings),
            seconds=seconds,
            formulation="B",
        )
