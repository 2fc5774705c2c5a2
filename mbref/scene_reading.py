"""Reading of scene files as TOML text and nested tables."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from mbref.scene_lines import toml_hint
from mbref.scene_validation import SceneError


def read_toml(path: str | Path) -> tuple[str, dict[str, Any]]:
    """Return the text of a TOML file (UTF-8) and its tables; raises SceneError that names the file."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
        data = tomllib.loads(text)
    except OSError as error:
        raise SceneError([f"{path}: cannot be read: {error.strerror}"]) from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError([f"{path}: is not TOML: {error}{toml_hint(text, str(error))}"]) from None
    except UnicodeDecodeError as error:
        raise SceneError([f"{path}: is not UTF-8 text (at byte {error.start})"]) from None
    except ValueError as error:  # a number of thousands of digits
        raise SceneError([f"{path}: is not TOML: {error}"]) from None
    except RecursionError:
        raise SceneError([f"{path}: is nested too deeply"]) from None
    return text, data
