"""Where a logger took the current and the positions at other moments, said in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ema_model.identification.fit import Fitted
from ema_model.quantities.numbers import amount

_SAMPLES = 0.3  # from which on it is worth saying
_SIGMAS = 4.0  # of its own uncertainty


def logged_apart(found: Fitted, covariance: NDArray[np.float64]) -> tuple[str, ...]:
    """A sentence for each recording whose current surely comes before its positions, or after them.

    covariance: of the fit's x (unknowns, unknowns).
    """
    told = []
    for one, x, variance in zip(found.problem.unknowns, found.x, np.diag(covariance)):
        if one.kind == "lag" and abs(x) > max(_SAMPLES, _SIGMAS * np.sqrt(variance)):  # 1 σ of the prior is a sample
            name = found.problem.model.measurements[one.place].name
            when = f"{amount(abs(one.sigma * x), 's')} {'after' if x > 0.0 else 'before'}"
            told.append(f"The current of {name} is logged {when} its positions, which is allowed for.")
    return tuple(told)
