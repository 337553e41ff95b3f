"""python -m ema_model.challenges [FOLDER]: makes the recordings of all challenges anew from their truths."""

from __future__ import annotations

import sys
from pathlib import Path

from ema_model.challenges.challenge import folder
from ema_model.challenges.truth import make, truths
from ema_model.errors import InputError


def main() -> int:
    """FOLDER holds truth/NAME.toml and, for each, NAME/challenge.toml; without one, the package's own."""
    where = Path(sys.argv[1]) if len(sys.argv) > 1 else folder()
    try:
        found = truths(where)
        if not found:
            raise InputError(f"{where}: there is no truth/NAME.toml in it; name a folder of challenges")
        for truth in found:
            if not (where / truth.name).is_dir():
                raise InputError(f"{where / truth.name}: no such folder; make it, with a challenge.toml")
            make(truth, where)
            print(where / truth.name)
    except InputError as error:
        print(f"challenges: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
