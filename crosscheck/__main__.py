"""`python -m crosscheck`: the same as the command `crosscheck`."""

import sys

from crosscheck.cli import main

sys.exit(main())
