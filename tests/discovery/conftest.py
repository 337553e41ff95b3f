"""Hidden effects are made as in the comparison's tests: by the three-phase model, with noise, off within tolerance."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "comparison"))
