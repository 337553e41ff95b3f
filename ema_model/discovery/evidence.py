"""The evidence of a model: how probable it makes the recordings, whatever its parameters and its noise.

About a fitted model the signals are taken as straight in the parameters and in the amount of each further Term, so
that the evidence of any set of Terms is a few solves of as many unknowns as it has: the most probable parameters within
their bounds, and how far the recordings narrow them (Laplace; MacKay, Neural Computation 4, 1992).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.noise import NoiseModel

Array = NDArray[np.float64]

_STEPS = 12  # of reweighted least squares
_SETTLED = 0.05  # of the logarithm of a probability
_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Amounts that are to be found: what each changes, what is known of it beforehand, and where it ends."""

    columns: Array  # (values, unknowns), in the noise model's coefficients
    mean: Array  # (unknowns,)
    sigma: Array  # (unknowns,)
    low: Array  # (unknowns,)
    high: Array  # (unknowns,)

    def beside(self, others: Sequence[Unknowns]) -> Unknowns:
        """These and others."""
        every = [self, *others]
        return Unknowns(
            np.hstack([one.columns for one in every]),
            *(np.concatenate([getattr(one, name) for one in every]) for name in ("mean", "sigma", "low", "high")),
        )

    def without(self, places: Sequence[int]) -> Unknowns:
        """All but some."""
        left = np.setdiff1d(np.arange(len(self.mean)), places)
        return Unknowns(self.columns[:, left], self.mean[left], self.sigma[left], self.low[left], self.high[left])


@dataclass(frozen=True, eq=False)
class Evidence:
    """Of one set of unknowns."""

    log: float  # of the probability of the recordings
    amounts: Array  # (unknowns,), the most probable
    residual: Array  # (values,), with them
    levels: Array  # of the noise, with them


def evidence_of(noise: NoiseModel, residual: Array, unknowns: Unknowns, levels: Array | None = None) -> Evidence:
    """The evidence of residual + columns · amounts; residual: (values,), in the noise model's coefficients.

    levels: from where those of the noise are sought.
    """
    columns, precision = unknowns.columns, unknowns.sigma**-2.0
    left, amounts = residual, np.clip(np.zeros(len(precision)), unknowns.low, unknowns.high)
    normal = np.diag(precision)
    levels = noise.levels(left, levels)
    last = posterior = -np.inf
    for _ in range(_STEPS):
        weighted = columns * noise.weights(left, levels)[:, None]
        normal = weighted.T @ columns + np.diag(precision)
        amounts = _within(normal, precision * unknowns.mean - weighted.T @ residual, unknowns.low, unknowns.high)
        left = residual + columns @ amounts
        levels = noise.levels(left, levels)
        away = (amounts - unknowns.mean) / unknowns.sigma
        posterior = noise.log_likelihood(left, levels) - 0.5 * float(away @ away)
        if posterior - last < _SETTLED:
            break
        last = posterior
    return Evidence(posterior - 0.5 * _narrowed(normal, unknowns.sigma), amounts, left, levels)


def evidence_at(noise: NoiseModel, residual: Array, unknowns: Unknowns, amounts: Array) -> tuple[float, float]:
    """Logarithm of the evidence about amounts that were simulated, with the residual (values,) that they leave.

    And of the likelihood there, with the base parameters' priors in σ: what the freedom of a model has no part in.
    """
    levels = noise.levels(residual)
    weighted = unknowns.columns * noise.weights(residual, levels)[:, None]
    normal = weighted.T @ unknowns.columns + np.diag(unknowns.sigma**-2.0)
    away = (amounts - unknowns.mean) / unknowns.sigma
    density = noise.log_likelihood(residual, levels) - 0.5 * float(away @ away)
    return density - 0.5 * _narrowed(normal, unknowns.sigma), density


def _narrowed(normal: Array, sigma: Array) -> float:
    """Twice the logarithm of how many times smaller the volume is that the recordings leave of what was known."""
    return float(np.linalg.slogdet(normal)[1]) + 2.0 * float(np.sum(np.log(sigma)))


def gains_of(noise: NoiseModel, found: Evidence, unknowns: Unknowns, others: Sequence[Unknowns]) -> Array:
    """About how much more evidence each of the others would give beside the unknowns, (others,).

    One step, at the noise as it is, with the noise that is left after it.
    """
    weights = noise.weights(found.residual, found.levels)
    before = noise.log_likelihood(found.residual, found.levels)
    free = (found.amounts > unknowns.low) & (found.amounts < unknowns.high)
    columns = unknowns.columns[:, free]
    weighted = columns * weights[:, None]
    normal = weighted.T @ columns + np.diag(unknowns.sigma[free] ** -2.0)
    together = np.hstack([one.columns for one in others])
    beyond = np.asfortranarray(together - columns @ np.linalg.solve(normal, weighted.T @ together))
    gains, first = np.zeros(len(others)), 0
    for i, one in enumerate(others):
        own = beyond[:, first : first + len(one.mean)]
        first += len(one.mean)
        precision = np.diag(one.sigma**-2.0)
        toward = -own.T @ (weights * found.residual)
        amounts = _within(own.T @ (own * weights[:, None]) + precision, toward, one.low, one.high)
        left = found.residual + own @ amounts
        levels = noise.levels(left, found.levels)
        energy = own.T @ (own * noise.weights(left, levels)[:, None]) + precision
        away = amounts / one.sigma
        gained = noise.log_likelihood(left, levels) - before
        gains[i] = gained - 0.5 * float(away @ away) - 0.5 * _narrowed(energy, one.sigma)
    return gains


def _within(normal: Array, toward: Array, low: Array, high: Array) -> Array:
    """The amounts within their bounds that come nearest to normal · amounts = toward."""
    count = len(toward)
    normal = normal + _RIDGE * (np.trace(normal) / max(1, count)) * np.eye(count)
    held = np.zeros(count, dtype=bool)
    amounts = np.zeros(count)
    for _ in range(count + 1):
        free = ~held
        if free.any():
            rest = toward[free] - normal[np.ix_(free, held)] @ amounts[held]
            amounts[free] = np.linalg.solve(normal[np.ix_(free, free)], rest)
        beyond = free & ((amounts < low) | (amounts > high))
        amounts = np.clip(amounts, low, high)
        if not beyond.any():
            break
        held |= beyond
    return amounts
