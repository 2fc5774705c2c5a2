"""Linear maps from the poses of all bodies to the variables of natural coordinates, and their evaluation."""

from __future__ import annotations

from numpy import cos, sin

from mbref.equations.evaluation import set_poses, set_velocities
from mbref.equations.functions import function_value
from mbref.kernels.compilation import kernel


@kernel
def read_variables(t, memory):
    """Compute values and rates of all variables at time t from the state in memory, as first terms of the
    series."""
    run, pose_maps, terms = memory.run, memory.pose_maps, memory.series.terms
    frames = run.equations.frames
    set_poses(run.state.coordinates, frames)
    set_velocities(run.state.velocities, frames)
    terms[0], terms[1] = 0.0, 0.0
    for i in range(pose_maps.body.shape[0]):
        body, driver = pose_maps.body[i], pose_maps.driver[i]
        x, x_rate = value_and_rate(i, pose_maps.along, body, frames)
        if driver >= 0:
            y, y_rate = value_and_rate(i, pose_maps.across, body, frames)
            angle, speed, _ = function_value(driver, t, run.equations)
            c, s = cos(angle), sin(angle)
            turned = s * x + c * y
            x, x_rate = c * x - s * y, c * x_rate - s * y_rate - speed * turned
        terms[0, i], terms[1, i] = x, x_rate


@kernel
def value_and_rate(i, forms, body, frames):
    """Return value and rate of the linear form in row i (12,) of a body's pose: position, rotation matrix R
    by rows.

    A row a of R has the rate a × ω', with ω' in the body's frame.
    """
    position, velocity = frames.position, frames.velocity
    a, omega = frames.rotation, frames.angular_velocity
    value, rate = 0.0, 0.0
    for k in range(3):
        value += forms[i, k] * position[body, k]
        rate += forms[i, k] * velocity[body, k]
        for row in range(3):
            j, l = 3 * row + (k + 1) % 3, 3 * row + (k + 2) % 3
            value += forms[i, 3 + 3 * row + k] * a[body, 3 * row + k]
            rate += forms[i, 3 + 3 * row + k] * (
                a[body, j] * omega[body, (k + 2) % 3] - a[body, l] * omega[body, (k + 1) % 3]
            )
    return value, rate
