"""python -m mbref"""

import sys

from mbref.cli import main

sys.exit(main())
