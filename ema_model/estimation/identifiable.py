"""Which of an actuator's free parameters a recording tells of, and which it cannot separate.

By the Fisher information of the calibration: F = JᵀJ of the signals over their floors, in units of each parameter's
own tolerance, so that the covariance beside the prior is (F + 1)⁻¹ (Bayesian Cramér–Rao bound).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.estimation.calibrate import Calibration

_NOTHING = 0.9  # of the prior's σ that is left were all others known, from which on the recording told nothing
_MUCH = 0.45  # of it that is left: n parameters of which only a ratio shows keep 1/√n each
_BY_OTHERS = 3.0  # how many times more is left than were all others known, where they take it up
_TOGETHER = 0.7  # correlation from which on a parameter is named as one of them


@dataclass(frozen=True)
class Told:
    """How far a recording narrows one free parameter."""

    name: str  # "section.parameter"
    left: float  # posterior σ over the tolerance's, 0 … 1
    alone: float  # the same if all others were known
    like: tuple[str, ...]  # free parameters that it trades against, most of all first

    @property
    def is_unseen(self) -> bool:
        """Whether the recording tells nothing of it, even were all else known."""
        return self.alone > _NOTHING

    @property
    def is_confounded(self) -> bool:
        """Whether it shows, but others of its direction take it up."""
        return not self.is_unseen and self.left > max(_MUCH, _BY_OTHERS * self.alone) and bool(self.like)


def told(calibration: Calibration) -> tuple[Told, ...]:
    """One for each free parameter, in the file's order."""
    jacobian = calibration.weighted_jacobian
    information = jacobian.T @ jacobian / calibration.covariance_scale
    covariance = np.linalg.inv(information + np.eye(len(information)))
    left = np.sqrt(np.diag(covariance))
    alone = 1.0 / np.sqrt(1.0 + np.diag(information))
    correlation = np.abs(covariance / np.outer(left, left))
    names = calibration.free
    found = []
    for i, name in enumerate(names):
        with_it = correlation[i, : len(names)]
        order = [int(j) for j in np.argsort(-with_it) if j != i and with_it[j] > _TOGETHER]
        found.append(Told(name, float(left[i]), float(alone[i]), tuple(names[j] for j in order)))
    return tuple(found)
