"""The option --motors of commands: joints whose motors cause the motion in place of drivers."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

from mbref.cli.request import Request
from mbref.motions.inverse_dynamics import check_motors, inverse_dynamics
from mbref.motions.motion import Motion


def add_motors(parser: argparse.ArgumentParser) -> None:
    """Add the option."""
    parser.add_argument(
        "--motors",
        nargs="+",
        metavar="JOINT",
        default=[],
        help="forces or torques of motors at these joints that cause the motion when all drivers are taken\n"
        "away: columns motor(A).torque and so on",
    )


def motion_by(
    run: Request,
    motors: Sequence[str],
    names: Sequence[str],
    finished: Callable[[Motion], Motion] = lambda motion: motion,
) -> Motion:
    """Return the ``finished`` motion with motors, if there are any.

    Motors, and columns by their names, are checked before the run; columns of motors after it.
    """
    if motors:
        check_motors(run.scene, motors)
    early = [name for name in names if not (motors and name.startswith("motor("))]
    motion = finished(run.motion((lambda first: finished(first).columns(*early)) if early else None))
    return inverse_dynamics(motion, motors) if motors else motion
