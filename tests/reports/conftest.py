"""Makes `synthetic` importable beside the tests that use it, and the fake engines of crosscheck."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path += [str(HERE), str(HERE.parent / "crosscheck")]
