"""Entry point of ``python -m mbref``, which runs the command ``mbref``."""

import sys

from mbref.cli import main

sys.exit(main())
