"""`python -m crosscheck`: the same as the command `crosscheck`."""

import sys

from crosscheck.cli.commands import main

sys.exit(main())
