"""Entry point of ``python -m crosscheck``, which runs the command ``crosscheck``."""

import sys

from crosscheck.cli import main

sys.exit(main())
