"""`python -m emaviz`."""

import sys

from emaviz.cli import main

if __name__ == "__main__":
    sys.exit(main())
