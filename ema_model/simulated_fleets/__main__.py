"""python -m ema_model.simulated_fleets FOLDER [SEED]: makes a fleet there, or tells the truth of the one there."""

from __future__ import annotations

import sys
from pathlib import Path

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from ema_model.simulated_fleets.fleet import TRUTH, draw, read_truth, write


def main() -> int:
    """SEED: a whole number from 0; units and differences are drawn from it."""
    arguments = sys.argv[1:]
    try:
        if not 1 <= len(arguments) <= 2 or (len(arguments) == 2 and not arguments[1].isdecimal()):
            raise InputError("python -m ema_model.simulated_fleets FOLDER [SEED], SEED a whole number from 0")
        folder = Path(arguments[0])
        if len(arguments) == 2 or not (folder / TRUTH).exists():
            write(draw(load_actuator(), int(arguments[1]) if len(arguments) == 2 else 0), folder)
            print(folder)
        else:
            for one in read_truth(folder):
                print(one)
    except InputError as error:
        print(f"fleets: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
