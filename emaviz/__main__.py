"""`python -m emaviz`."""

import sys


def program() -> int:
    """The command line as a program, which an interrupt ends from its first import on; returns the exit code."""
    try:
        from emaviz.cli import main

        return main()
    except KeyboardInterrupt:  # before `main` takes care of it
        return 130


if __name__ == "__main__":
    sys.exit(program())
