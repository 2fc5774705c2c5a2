"""Pictures of a mechanism as SVG, still or animated: panels that show motions on top of each other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mbref.input_error import InputError
from mbref.motions.drawing import svg
from mbref.motions.drawing.labels import names
from mbref.motions.drawing.marks import Stage, coupling_mark, driver_mark, ground_mark, joint_mark, load_mark
from mbref.motions.drawing.shapes import Shape, anchors, at_rest, attack, rim, shapes
from mbref.motions.drawing.svg import COLOURS, GREY, INK, Picture
from mbref.motions.drawing.timeline import Timeline
from mbref.motions.drawing.view import BESIDE, Form, Page, View, round_length, view_of
from mbref.motions.joint_motion import carried, positions_of
from mbref.motions.trajectory import Trajectory
from mbref.scene import GROUND, RollingWheel, Scene

FOOT, CLOCK = 30.0, 42.0  # px; heights of the row for axes and scale, and of the row for the line of time
LEADING = 1.5  # height of a title line / height of its letters


def signs(stage: Stage) -> Iterator[str]:
    """Yield the symbols of couplings, loads, joints and drivers."""
    yield from (coupling_mark(stage, coupling) for coupling in stage.scene.coupling)
    yield from (load_mark(stage, load) for load in stage.scene.load)
    for joint in stage.scene.joint:
        yield from joint_mark(stage, joint)
    yield from (driver_mark(stage, driver) for driver in stage.scene.driver)


class Look(NamedTuple):
    """Style of bodies: one colour, or each body's own; thickness of bars, px; opacity from 0 to 1."""

    colour: str = ""
    thickness: float = 6.0
    opacity: float = 1.0


class Layer(NamedTuple):
    """Bodies of a motion in a style, and functions such as ``signs`` and ``names`` that yield further
    symbols."""

    motion: Trajectory
    look: Look = Look()
    more: Sequence[Callable[[Stage], Iterable[str]]] = (signs,)


class Panel(NamedTuple):
    """Layers drawn on top of each other below the lines of a title, and paths (n, 3) in space, m, drawn in
    grey."""

    layers: Sequence[Layer]
    title: Sequence[str] = ()
    paths: Sequence[np.ndarray] = ()


def still(scene: Scene, view: View | None = None, width: float = Form().width) -> Picture:
    """Return the scene at t = 0 as the text of an SVG, which a notebook shows as a picture.

    Parameters
    ----------
    scene : Scene
        The mechanism.
    view : View, optional
        Direction of sight. Default: normal to the plane of the mechanism, otherwise oblique.
    width : float
        Width of the picture, px.

    Returns
    -------
    str
        The SVG.
    """
    panel = Panel([Layer(at_rest(scene), more=(signs, names))])
    return Picture(picture(scene, [panel], _title(scene), view=view, form=Form(width)))


def moving(
    scene: Scene, motion: Trajectory, view: View | None = None, width: float = Form().width
) -> Picture:
    """Return the motion as animated SVG, in real time if its duration is 4 to 12 s.

    The animation shows every n-th of the samples, at most 120.  Raises InputError if there is no sample.
    """
    _check([motion])
    panel, timeline = Panel([Layer(motion, more=(signs, names))]), Timeline.of(motion.times)
    return Picture(picture(scene, [panel], _title(scene), timeline, view, Form(width)))


def frames(scene: Scene, motion: Trajectory, view: View | None = None) -> Iterator[str]:
    """Yield the displayed samples, each as a still SVG of equal size and equal part of space."""
    _check([motion])
    for sample in Timeline.of(motion.times).samples:
        panel = Panel([Layer(_at(motion, [sample]), more=(signs, names))])
        yield picture(scene, [panel], _title(scene), view=view, form=Form(), shown=[motion])


def side_by_side(
    scene: Scene, motions: Mapping[str, Trajectory], words: str, view: View | None = None
) -> str:
    """Return motions over one span of time as one animated SVG, two in a row, below their titles.

    A motion that ended early stays at its last sample. Raises InputError if a trajectory has no sample.
    """
    _check(motions.values())
    panels = [Panel([Layer(motion)], [title]) for title, motion in motions.items()]
    return picture(scene, panels, words, Timeline.of(longest(motions.values())), view, BESIDE)


def longest(motions: Iterable[Trajectory]) -> np.ndarray:
    """Return the times (k,) of the motion with most samples."""
    return max((motion.times for motion in motions), key=len)


def picture(
    scene: Scene,
    panels: Sequence[Panel],
    words: str,
    timeline: Timeline | None = None,
    view: View | None = None,
    form: Form = BESIDE,
    shown: Sequence[Trajectory] = (),
) -> str:
    """Return panels of a scene as SVG, described by ``words``; it is not animated without a timeline.

    All panels show one part of space, which contains the motions ``shown``, by default all of its layers.
    Readers whose browser suppresses animation see all panels at one sample: the one at which a body is
    farthest from its position in the first layer.
    """
    motions = shown or [layer.motion for panel in panels for layer in panel.layers]
    space = _samples(motions, np.concatenate)
    page = _page(scene, space, view, form)
    rows = max(len(panel.title) for panel in panels)
    grid = _Grid(page, form, rows * LEADING * form.letters + 6.0 * bool(rows), len(panels))
    if timeline is None:
        parts = [*_drawn(scene, space, panels, grid, None)]
    else:
        frames = [_with_motions(panel, lambda motion: _at(motion, timeline.samples)) for panel in panels]
        rest = _furthest([layer.motion for panel in frames for layer in panel.layers])
        stands = [_with_motions(panel, lambda motion: _at(motion, [rest])) for panel in frames]
        parts = svg.moving_or_still(
            [*_drawn(scene, space, frames, grid, timeline), *_clock(grid, timeline, timeline.times)],
            [*_drawn(scene, space, stands, grid, None), *_clock(grid, timeline, timeline.times[[rest]])],
        )
    parts += [*_titles(panels, grid), *_axes(page, grid), *_scale(grid), *_pace(grid, timeline)]
    height = grid.bottom + FOOT + CLOCK * bool(timeline and timeline.marks)
    return svg.document(grid.width, height, parts, words)


def _title(scene: Scene) -> str:
    return f"{scene.name}: {len(scene.body)} bodies, {len(scene.joint)} joints"


def _check(motions: Iterable[Trajectory]) -> None:
    for motion in motions:
        if not motion.times.size:
            raise InputError(
                f"the motion of {motion.scene!r} has no sample to draw: {motion.outcome.sentence}"
            )


class _Grid(NamedTuple):
    """Positions of panels in a picture: the page of each, sizes, height of titles (px), number of panels."""

    page: Page
    form: Form
    head: float
    number: int

    def corner(self, k: int) -> tuple[float, float]:
        """Return the upper left corner, px, of the k-th panel, from 0, with its title."""
        row, column = divmod(k, self.form.columns)
        return self.form.width * column, (self.head + self.page.height) * row

    @property
    def width(self) -> float:
        """Width of all panels, px."""
        return self.form.width * self.form.columns

    @property
    def bottom(self) -> float:
        """Height of all panels, px."""
        return self.corner(self.number + self.form.columns - 1)[1]


def _page(scene: Scene, shown: Trajectory, view: View | None, form: Form) -> Page:
    """Return the page that shows all of a motion, and anchors and ends of springs on the ground."""
    fixed = [a for joint in scene.joint for name, a in anchors(joint) if name == GROUND]
    fixed += [p for load in scene.load for name, p in attack(load) if name == GROUND]
    bodies = [carried(shape.points, shown, b).reshape(-1, 3) for b, shape in enumerate(shapes(scene))]
    wheels = [joint for joint in scene.joint if isinstance(joint, RollingWheel)]
    rims = [
        positions_of(scene, shown, wheel.bodies[1], rim(wheel).tolist()).reshape(-1, 3) for wheel in wheels
    ]
    points = np.concatenate([*bodies, *rims, np.array(fixed).reshape(-1, 3)])
    axes = [joint.axis for joint in scene.joint if joint.type == "revolute"]
    return Page.around(points, view or view_of(points, axes), form.width, form.margin, form.tallest)


def _with_motions(panel: Panel, change: Callable[[Trajectory], Trajectory]) -> Panel:
    """Return the panel with the motion of each layer replaced."""
    return panel._replace(layers=[layer._replace(motion=change(layer.motion)) for layer in panel.layers])


def _at(motion: Trajectory, samples: Any) -> Trajectory:
    """Return the motion at samples given by number (k,); its last sample replaces missing ones."""
    return _samples([motion], lambda values: values[0][np.minimum(samples, len(motion.times) - 1)])


def _samples(motions: Sequence[Trajectory], choose: Callable[[list[np.ndarray]], np.ndarray]) -> Trajectory:
    """Return poses and velocities that a function selects from several motions."""
    fields = ("times", "position", "orientation", "velocity", "angular_velocity")
    chosen: dict[str, Any] = {name: choose([getattr(motion, name) for motion in motions]) for name in fields}
    first = motions[0]
    return Trajectory(first.scene, first.engine, first.version, "", {}, bodies=first.bodies, **chosen)


def _furthest(motions: Sequence[Trajectory]) -> int:
    """Return the sample at which a body is farthest from its position in the first motion."""
    places = np.array([motion.position for motion in motions])
    return int(np.linalg.norm(places - places[0], axis=-1).max(axis=(0, 2)).argmax())


def _drawn(
    scene: Scene, shown: Trajectory, panels: Sequence[Panel], grid: _Grid, timeline: Timeline | None
) -> Iterator[str]:
    """Yield the panels, each clipped at its edges."""
    still, held = Stage(scene, shown, grid.page, None), (j for j in scene.joint if GROUND in j.bodies)
    ground = [part for joint in held for part in ground_mark(still, joint)]
    for k, panel in enumerate(panels):
        x, y = grid.corner(k)
        parts = [*ground, *(svg.line(grid.page.pixels(path)[None], PATH_LOOK, None) for path in panel.paths)]
        for layer in panel.layers:
            stage = Stage(scene, layer.motion, grid.page, timeline)
            parts += _bodies(stage, layer.look)
            parts += [part for more in layer.more for part in more(stage)]
        size = f'width="{grid.form.width:g}" height="{grid.page.height:.1f}"'
        yield f'<svg x="{x:g}" y="{y + grid.head:.1f}" {size}>{"".join(parts)}</svg>'


PATH_LOOK = f'fill="none" stroke="{GREY}" stroke-width="0.8"'


def _bodies(stage: Stage, look: Look) -> Iterator[str]:
    """Yield the bodies of a layer."""
    opacity = f' opacity="{look.opacity:.3g}"' * (look.opacity < 1)
    for b, shape in enumerate(shapes(stage.scene)):
        frames = stage.page.pixels(carried(shape.points, stage.motion, b))
        yield _body(shape, frames, look.colour or COLOURS[b % len(COLOURS)], look.thickness, opacity, stage)


def _body(shape: Shape, frames: np.ndarray, colour: str, thickness: float, opacity: str, stage: Stage) -> str:
    """Return a plate, a bar, or a block if the body has one point only."""
    area = f'fill="{colour}" fill-opacity="0.18" stroke="{colour}"{opacity}'
    if shape.is_plate:
        look = f'{area} stroke-width="{thickness / 1.5:.3g}"'
        return svg.line(frames[:, :-1], look, stage.timeline, closed=True)
    if frames.shape[1] == 1:
        look = f'x="-17" y="-12" width="34" height="24" rx="3" stroke-width="{thickness / 2:.3g}"'
        return svg.follow(frames[:, 0], f"<rect {look} {area}/>", stage.timeline)
    look = f'fill="none" stroke="{colour}"{opacity} stroke-width="{thickness:g}"'
    return svg.line(frames, look, stage.timeline)


def _titles(panels: Sequence[Panel], grid: _Grid) -> Iterator[str]:
    """Yield the titles above the panels, the first line of each in bold if it has several."""
    size = grid.form.letters
    for k, panel in enumerate(panels):
        x, y = grid.corner(k)
        for i, words in enumerate(panel.title):
            weight = ' font-weight="600"' * (i == 0 and len(panel.title) > 1)
            look = f'fill="{INK}" font-size="{size}"{weight}'
            yield svg.text(x + grid.form.width / 2, y + (i + 1) * LEADING * size, words, look)


def _axes(page: Page, grid: _Grid) -> Iterator[str]:
    """Yield arrows of x, y and z in the lower left corner, except one along the line of sight."""
    corner = np.array([30.0, grid.bottom + FOOT - 26])
    for name, seen in zip("xyz", page.directions(np.eye(3)), strict=True):
        if np.hypot(*seen) > 0.2:
            end = corner + 30 * seen
            yield svg.arrow(corner, end, GREY, 1.3)
            x, y = end + 10 * seen / np.hypot(*seen)
            yield svg.text(x, y + 4, name, f'fill="{GREY}" font-size="12"')


def _scale(grid: _Grid) -> Iterator[str]:
    """Yield a scale bar, labelled with its round length in m."""
    scale = grid.page.scale
    length = round_length(110 / scale)
    left, y = grid.width - 40 - length * scale, grid.bottom + FOOT - 20
    ends = f"M{left:.1f} {y - 4:.1f}v8m0 -4h{length * scale:.1f}m0 -4v8"
    yield f'<path d="{ends}" stroke="{INK}" fill="none"/>'
    yield svg.text(left + length * scale / 2, y - 7, f"{length:g} m", _words(grid))


def _pace(grid: _Grid, timeline: Timeline | None) -> Iterator[str]:
    """Yield the text on the speed of an animation relative to real time."""
    if timeline:
        words = f"{timeline.times[-1] - timeline.times[0]:.4g} s in {timeline.seconds:.3g} s"
        yield svg.text(grid.width / 2, grid.bottom + FOOT - 16, words, _words(grid))


def _words(grid: _Grid) -> str:
    return f'fill="{INK}" font-size="{grid.form.letters}"'


def _clock(grid: _Grid, timeline: Timeline, times: np.ndarray) -> Iterator[str]:
    """Yield the line of time with its marks, and a dot at times (k,), s, if there is anything to mark."""
    if not timeline.marks:
        return
    y, size = grid.bottom + FOOT + 14.0, grid.form.letters
    left = 40.0 + 0.56 * size * len(timeline.label)
    right = grid.width - 60.0
    ticks, dot, ends = (
        left + (right - left) * timeline.fractions(np.array(instants))
        for instants in (timeline.marks, times, timeline.times[[0, -1]])
    )
    path = f"M{left:.1f} {y:.1f}H{right:.1f}" + "".join(f"M{x:.1f} {y - 7:.1f}v14" for x in ticks)
    yield f'<path d="{path}" stroke="{INK}" fill="none"/>'
    yield svg.text(14, y + 4, timeline.label, _words(grid), "start")
    for x, time in zip(ends, timeline.times[[0, -1]], strict=True):
        yield svg.text(x, y + 20, f"{round(time, 12):.4g} s", _words(grid))
    places = np.stack([dot, np.full_like(dot, y)], axis=1)
    moves = timeline if len(times) > 1 else None
    yield svg.follow(places, f'<circle r="5" fill="{COLOURS[1]}"/>', moves)
