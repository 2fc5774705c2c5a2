"""Options that several commands share, and the run that they request: scene, method, times and limits."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbref.cli.output import progress_bar, warn
from mbref.command_line import MOST_DURATION, whole
from mbref.formulations import FORMULATIONS
from mbref.input_error import InputError
from mbref.integrators import INTEGRATORS
from mbref.method import (
    SERIES_METHOD,
    SPARSE_METHOD,
    Method,
    MethodError,
    default_method,
)
from mbref.motions.output_units import requested_units
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.stabilisation import STABILISATIONS

if TYPE_CHECKING:
    from mbref.motions.motion import Motion
    from mbref.stepping.limits import Limits

MOST_SAMPLES = 1_000_000
MOST_STATES = 10_000_000  # samples times bodies of a run; a state takes about 200 bytes
# option of a command line by the field of Limits that it sets
LIMIT_OPTIONS = {"rtol": "--rtol", "largest_step": "--max-step", "branches": "--branch", "code": "--code"}


def add_scene(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the scene."""
    parser.add_argument("scene", metavar="SCENE", help="a built-in name (mbref list scenes) or a .toml file")


def add_method_options(parser: argparse.ArgumentParser, json: bool = True) -> None:
    """Add options for method, times and limits of a run, and --json if the command prints its result."""
    parser.add_argument(
        "--method",
        help=f"{SERIES_METHOD}, or formulation+stabilisation/integrator;\n"
        f"formulations: {', '.join(FORMULATIONS)};\nstabilisations: {', '.join(STABILISATIONS)};\n"
        f"integrators: {', '.join(INTEGRATORS)} (default: {SERIES_METHOD},\nfor many bodies {SPARSE_METHOD})",
    )
    add_time_options(parser)
    parser.add_argument("--rtol", type=float, default=1e-9, help="relative tolerance per step (default 1e-9)")
    parser.add_argument(
        "--code",
        choices=("auto", "generic", "generated"),
        default="auto",
        help="code of the method taylor: generic (one code for all scenes), generated (machine code for\n"
        "this scene) or auto (default: generated for more than 20 000 expected steps); equal to rounding",
    )
    parser.add_argument("--max-step", type=float, default=0.0, help="largest step, s (default: the duration)")
    if json:
        parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def add_units(parser: argparse.ArgumentParser) -> None:
    """Add --units."""
    parser.add_argument(
        "--units",
        type=checked_units,
        metavar="UNITS",
        help='units of the output, e.g. mm,deg or kN,rpm (default: SI); "N mm" holds for moments only',
    )


def checked_units(text: str) -> str:
    """Return units such as "mm,deg"; raises ArgumentTypeError for an unknown one."""
    try:
        requested_units(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error).removeprefix("units: ")) from None
    return text


def add_time_options(parser: argparse.ArgumentParser) -> None:
    """Add --times, --samples and --duration."""
    when = parser.add_mutually_exclusive_group()
    when.add_argument("--times", help="sample times in s, increasing, e.g. 0.1,0.2,0.4")
    when.add_argument(
        "--samples",
        type=whole(2, MOST_SAMPLES),
        help=f"this many equally spaced times from 0 to the duration (2 to {MOST_SAMPLES})",
    )
    about = f"end time in s, at most {MOST_DURATION:g} (default: the scene's)"
    parser.add_argument("--duration", type=float, help=about)


class Request(NamedTuple):
    """Arguments of ``simulate``."""

    scene: Scene
    method: Method | str | None  # None for the default
    times: np.ndarray  # (k,), s
    limits: Limits

    def motion(self, check: Callable[[Motion], object] | None = None) -> Motion:
        """Return the motion; kernels that this machine has not are compiled first, in two processes.

        ``check`` is called before, with the motion up to the first sample time.
        """
        from mbref.simulation.simulate import are_compiled, check_method, prepare, simulate

        method = self.method or default_method(self.scene)
        method = Method.parse(method) if isinstance(method, str) else method
        try:
            if self.method:
                check_method(method, self.scene, self.limits)
            if not are_compiled(method, self.scene):
                prepare(method, self.scene)
            with progress_bar("simulating", float(self.times[-1])) as progress:
                if check:
                    check(simulate(*self._replace(times=self.times[:1]), progress))
                return simulate(*self, progress)
        except (MethodError, InputError) as error:
            raise type(error)(with_option(str(error))) from None


def request_of(options: argparse.Namespace, branches: Mapping[int, int] | None = None) -> Request:
    """Return the run that the options request, with branches by crossing; prints warnings about its scene.

    Raises SceneError, or InputError that names the faulty option.
    """
    scene = find_scene(options.scene)
    times, limits = sample_times(options, scene), limits_of(options, branches)
    warn(scene)
    return Request(scene, options.method, times, limits)


def sample_times(options: argparse.Namespace, scene: Scene) -> np.ndarray:
    """Return the sample times that the options request; raises InputError that names the faulty option."""
    duration = scene.duration if options.duration is None else options.duration
    if not 0 < duration <= MOST_DURATION:
        raise InputError(f"--duration: must be positive and at most {MOST_DURATION:g} s, got {duration:g}")
    if options.times is None:
        samples = 101 if options.samples is None else options.samples
        if samples * len(scene.body) > MOST_STATES:
            most = MOST_STATES // len(scene.body)
            raise InputError(f"--samples: must be at most {most} for {len(scene.body)} bodies, got {samples}")
        return np.linspace(0.0, duration, samples)
    try:
        times = np.array([float(word) for word in options.times.split(",")])
    except ValueError:
        raise InputError(f"--times: must be numbers separated by commas, got {options.times!r}") from None
    if not np.isfinite(times).all() or times[0] < 0 or np.any(np.diff(times) <= 0):
        raise InputError(f"--times: must be finite, not negative and increasing, got {options.times}")
    if times[-1] > MOST_DURATION:
        raise InputError(f"--times: must be at most {MOST_DURATION:g} s, got {times[-1]:g}")
    if options.duration is not None and times[-1] > duration:
        raise InputError(f"--times: must end by --duration {duration:g}, got {times[-1]:g}")
    return times


def limits_of(options: argparse.Namespace, branches: Mapping[int, int] | None = None) -> Limits:
    """Return the limits; raises InputError that names the faulty option."""
    from mbref.stepping.limits import Limits

    try:
        return Limits(
            rtol=options.rtol, largest_step=options.max_step, code=options.code, branches=branches or {}
        )
    except ValueError as error:
        raise InputError(with_option(str(error))) from None


def with_option(message: str) -> str:
    """Return a message that begins with a field of ``Limits`` with the option in place of the field."""
    field, colon, rest = message.partition(":")
    return f"{LIMIT_OPTIONS[field]}{colon}{rest}" if field in LIMIT_OPTIONS else message
