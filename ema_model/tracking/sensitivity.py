"""What a unit's base parameters add to k̂, stated for one state of wear.

Backlash is the play × (1 + 99 k2), so that what is uncertain of the play (15 %) moves k2 in proportion to what wear has
made of it: a flight's sensitivity grows with the very k that it tells.  Taken as it is it would explain any growth of
k2 by a unit that is 1/0.15 σ off, and no growth costs more.  Of a k that does not wear the sensitivity may differ
between commands and loads, but does not grow with that k.  Other faults grow theirs too little to be explained by it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model import faults

Array = NDArray[np.float64]


def growth(k: ArrayLike) -> Array:
    """(…, 8), by what the sensitivity of each k̂ (…, 8) to the base parameters grows with that k itself.

    k̂ may lie beyond its range, as noise takes it, and counts as its nearest end: there it was linearised.
    """
    grown = np.ones(np.shape(k))
    grown[..., 1] = faults.physical(np.clip(k, 0.0, 1.0)).backlash_factor
    return grown
