"""SVG as PNG, by resvg."""

from __future__ import annotations


def png(svg: str, zoom: int = 2) -> bytes:
    """Return the picture as PNG at twice its size; of an animation, the first frame.

    Raises ValueError without resvg.
    """
    try:
        import resvg_py
    except ImportError:
        raise ValueError("PNG needs resvg: pip install 'mbref[draw]'; SVG needs nothing more") from None
    return bytes(resvg_py.svg_to_bytes(svg_string=svg, zoom=zoom))
