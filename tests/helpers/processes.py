"""Processes of the operating system that a test waits for."""

import time
from pathlib import Path

PATIENCE = 60.0  # s in which a killed process disappears on a loaded machine


def is_gone(process: int) -> bool:
    """Return whether a process ends within PATIENCE."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            state = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except (FileNotFoundError, ProcessLookupError):  # the second: it ended while it was read
            return True
        if state == "Z":  # it ended, and its parent has not asked for its status yet
            return True
        time.sleep(0.02)
    return False
