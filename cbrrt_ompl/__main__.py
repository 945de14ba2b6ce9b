"""``python -m cbrrt_ompl`` is ``cbrrt``."""

import sys

from cbrrt_ompl.cli import main

if __name__ == "__main__":
    sys.exit(main())
