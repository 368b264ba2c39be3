"""`python -m tissuejax`: the command line."""

import sys

from tissuejax.cli import main

if __name__ == "__main__":
    sys.exit(main())
