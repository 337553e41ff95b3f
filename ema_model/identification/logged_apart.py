"""Where a logger took the current and the positions at other moments, said in words."""

from __future__ import annotations

import numpy as np

from ema_model.identification.fit import Fitted
from ema_model.quantities.numbers import amount

_SAMPLES = 0.3  # from which on it is worth saying
_SIGMAS = 4.0  # of its own uncertainty


def logged_apart(found: Fitted) -> tuple[str, ...]:
    """A sentence for each recording whose current surely comes before its positions, or after them."""
    problem = found.problem
    lags = [i for i, one in enumerate(problem.unknowns) if one.kind == "lag"]
    if not lags:
        return ()
    spread = np.sqrt(np.diag(np.linalg.inv(found.slopes.T @ found.slopes)))
    told = []
    for i in lags:
        one = problem.unknowns[i]
        if abs(found.x[i]) > max(_SAMPLES, _SIGMAS * spread[i]):  # 1 σ of the prior is a sample
            name = problem.model.measurements[one.place].name
            when = f"{amount(abs(one.sigma * found.x[i]), 's')} {'after' if found.x[i] > 0.0 else 'before'}"
            told.append(f"The current of {name} is logged {when} its positions, which is allowed for.")
    return tuple(told)
