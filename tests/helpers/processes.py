"""Processes of the operating system that a test waits for."""

import time
from pathlib import Path

PATIENCE = 60.0  # s in which a killed process disappears on a loaded machine


def is_gone(process: int) -> bool:
    """Return whether a process ends within PATIENCE."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        status = Path(f"/proc/{process}/stat")
        if not status.exists() or status.read_text().rsplit(")", 1)[1].split()[0] == "Z":
            return True
        time.sleep(0.02)
    return False
