"""Pictures as PNG (by resvg), and animated mechanisms as SVG, GIF (by Pillow) or MP4 (by ffmpeg)."""

from __future__ import annotations

import io
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from mbref.files import replaced
from mbref.input_error import InputError
from mbref.motions.drawing.picture import frames, moving
from mbref.motions.drawing.timeline import Timeline
from mbref.motions.drawing.view import View
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

MOVING = (".svg", ".gif", ".mp4")  # suffixes of animations
BLOCK = 16  # px; size of blocks of the video codec
MISSING = "{} needs {}: pip install 'mbref[video]'; SVG needs nothing more"


def png(svg: str, zoom: int = 2) -> bytes:
    """Return the picture as PNG at twice its size; of an animation, the first frame.

    Raises InputError without resvg.
    """
    try:
        import resvg_py
    except ImportError:
        raise InputError("PNG needs resvg: pip install 'mbref[draw]'; SVG needs nothing more") from None
    return bytes(resvg_py.svg_to_bytes(svg_string=svg, zoom=zoom))


def write_film(path: Path, scene: Scene, motion: Trajectory, view: View | None = None) -> None:
    """Write the motion as .svg, .gif or .mp4, in real time if one round of it takes 4 to 12 s.

    Raises InputError if a library is not installed or the trajectory has no sample.
    """
    writers = dict(zip(MOVING, (_write_svg, _write_gif, _write_mp4), strict=True))
    with replaced(path) as fresh:
        writers[path.suffix](fresh, scene, motion, view)


def _write_svg(path: Path, scene: Scene, motion: Trajectory, view: View | None) -> None:
    path.write_text(moving(scene, motion, view), encoding="utf-8")


def _write_gif(path: Path, scene: Scene, motion: Trajectory, view: View | None) -> None:
    try:
        import PIL.Image  # noqa: F401
    except ImportError:
        raise InputError(MISSING.format("GIF", "Pillow")) from None
    first, *others = [image.quantize(64) for image in _images(scene, motion, view)]
    ends = np.linspace(0.0, 100.0 * Timeline.of(motion.times).seconds, 2 + len(others))
    durations = (10.0 * np.diff(np.round(ends))).tolist()  # ms; the unit of time in a GIF is 10 ms
    first.save(path, save_all=True, append_images=others, duration=durations, loop=0, optimize=True)


def _write_mp4(path: Path, scene: Scene, motion: Trajectory, view: View | None) -> None:
    try:
        import imageio_ffmpeg
        import PIL.Image  # noqa: F401
    except ImportError:
        raise InputError(MISSING.format("MP4", "imageio-ffmpeg and Pillow")) from None
    timeline, images = Timeline.of(motion.times), _images(scene, motion, view)
    first = next(images)
    pixels = _padded(first)
    film = imageio_ffmpeg.write_frames(
        str(path), pixels.shape[1::-1], fps=len(timeline.times) / timeline.seconds, macro_block_size=BLOCK
    )
    film.send(None)
    for each in chain([pixels], map(_padded, images)):
        film.send(np.ascontiguousarray(each))
    film.close()


def _images(scene: Scene, motion: Trajectory, view: View | None) -> Iterator[Any]:
    """Yield the displayed samples as images of Pillow."""
    from PIL import Image

    for picture in frames(scene, motion, view):
        yield Image.open(io.BytesIO(png(picture, 1))).convert("RGB")


def _padded(image: Any) -> np.ndarray:
    """Return the pixels (rows, columns, 3) of an image, with white added up to whole blocks of the codec."""
    pixels = np.asarray(image)
    rows, columns = (-size % BLOCK for size in pixels.shape[:2])
    return np.pad(pixels, ((0, rows), (0, columns), (0, 0)), constant_values=255)
