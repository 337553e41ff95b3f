"""What explains a residual: variables, orders, pitches, curves, judged on what was left out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from ema_model.comparison.residuals import Residuals, explanation_sentence
from ema_model.quantities import MODULATORS, VARIABLES, Axes
from ema_model.recordings import SIGNALS
from ema_model.result import NULL, as_named

# --- least squares judged on stretches of time that were left out of the fit ------------------------------------------
# Neighbouring blocks are alike, so whole stretches are left out, never single blocks.

Array = NDArray[np.float64]

FOLDS = 5
_STRETCHES = 50  # over which the folds are shared out
_SHORTEST = 10  # blocks in a stretch
_RIDGE_OF_MEAN = 1e-6  # of the mean power of a column


@dataclass(frozen=True, eq=False)
class Folds:
    """Which stretch, and which fold, each block belongs to: (blocks,) each."""

    stretch: NDArray[np.intp]
    fold: NDArray[np.intp]

    def sums(self, values: Array) -> Array:
        """Sum of the values in each stretch, (stretches,)."""
        return np.bincount(self.stretch, values, int(self.stretch.max()) + 1).astype(np.float64)


def share_out(run: NDArray[np.intp], *, independent: bool = False) -> Folds:
    """Stretches of equal length that do not cross from one run to the next, dealt to the folds.

    Dealt in a shuffled order, since taking every fifth could beat against a periodic command.
    independent: blocks have no order in time, and each is a stretch.
    """
    length = 1 if independent else max(_SHORTEST, len(run) // _STRETCHES)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(run)) + 1])
    position = np.arange(len(run)) - np.repeat(starts, np.diff([*starts, len(run)]))
    label = np.cumsum(position % length == 0) - 1
    count = int(label[-1]) + 1
    random = np.random.default_rng(0)
    dealt = np.concatenate([random.permutation(FOLDS) for _ in range(-(-count // FOLDS))])[:count]
    return Folds(label.astype(np.intp), dealt[label].astype(np.intp))


@dataclass(frozen=True, eq=False)
class Given:
    """Columns that every fit has; a prior of variance 1 pulls their coefficients toward `prior`."""

    columns: Array  # (blocks, given)
    prior: Array  # (given,)
    room: tuple[Array, Array]  # (given,) each, least and greatest coefficients


def nothing_given(blocks: int) -> Given:
    """No such columns."""
    return Given(np.zeros((blocks, 0)), np.zeros(0), (np.zeros(0), np.zeros(0)))


class LeftOut:
    """Normal equations of y ≈ G g + X c, kept per fold, so that leaving one out costs no pass over the data.

    G are the given columns; gains are what X tells beyond them.
    """

    def __init__(self, columns: Array, y: Array, folds: Folds, given: Given) -> None:
        self.columns = np.concatenate([given.columns, columns], axis=1)
        self.y, self.folds, self.given = y, folds, given
        self._members = [folds.fold == fold for fold in range(FOLDS)]
        self._grams = np.stack([self.columns[member].T @ self.columns[member] for member in self._members])
        self._moments = np.stack([self.columns[member].T @ y[member] for member in self._members])

    def equations(self, fold: int | None) -> tuple[Array, Array]:
        """Gram matrix, with its ridge, and moments of all folds but this one (None: of all)."""
        gram, moment = self._grams.sum(axis=0), self._moments.sum(axis=0)
        share = 1.0
        if fold is not None:
            gram, moment = gram - self._grams[fold], moment - self._moments[fold]
            share = 1.0 - 1.0 / FOLDS
        n = len(self.given.prior)
        own = np.diag(gram)[n:]
        ridge = _RIDGE_OF_MEAN * float(np.mean(own)) if own.size else 0.0
        gram = gram + ridge * np.eye(len(gram))
        moment = moment.copy()
        gram[:n, :n] += share * np.eye(n)
        moment[:n] += share * self.given.prior
        return gram, moment

    def gains(self, choices: list[NDArray[np.intp]] | None = None, *, bounded: bool = False) -> Array:
        """What X takes off the squared error of each stretch where it was left out, beyond the given columns.

        choices: columns of X to take for each fold; all, without them.  bounded: keep the given columns'
        coefficients within their room, which takes ten times as long.
        """
        n = len(self.given.prior)
        fixed = np.arange(n)
        every = [np.arange(self.columns.shape[1] - n)] * FOLDS
        left = self._errors([np.concatenate([fixed, n + chosen]) for chosen in choices or every], bounded)
        return self.folds.sums(self._errors([fixed] * FOLDS, bounded) ** 2 - left**2)

    def _errors(self, choices: list[NDArray[np.intp]], bounded: bool) -> Array:
        errors = self.y.copy()
        for fold, (member, chosen) in enumerate(zip(self._members, choices)):
            if len(chosen):
                gram, moment = self.equations(fold)
                solve = self._within if bounded else np.linalg.solve
                coefficients = solve(gram[np.ix_(chosen, chosen)], moment[chosen])
                errors[member] -= self.columns[np.ix_(member, chosen)] @ coefficients
        return errors

    def _within(self, gram: Array, moment: Array) -> Array:
        """The coefficients, those of the given columns, which come first, within their room."""
        from scipy.optimize import lsq_linear  # takes a third of a second to import

        n = len(self.given.prior)
        free = np.full(len(moment) - n, np.inf)
        scale = 1.0 / np.sqrt(np.diag(gram))
        root = np.linalg.cholesky(gram * np.outer(scale, scale) + 1e-9 * np.eye(len(gram)))
        target = np.linalg.solve(root, moment * scale)
        low, high = (np.concatenate([side, way * free]) / scale for side, way in zip(self.given.room, (-1.0, 1.0)))
        return lsq_linear(root.T, target, (low - 1e-12, high + 1e-12), method="bvls").x * scale

    def pursue(self, fold: int | None, pairs: int) -> list[int]:
        """Pairs of columns (0, 1), (2, 3), … of X that reduce the error most, one after another, a fold left out.

        Orthogonal matching pursuit; returns the pairs' numbers from 0, best first.
        """
        matrix, moment = self.equations(fold)
        n = len(self.given.prior)
        count = (len(matrix) - n) // 2
        first, second = n + np.arange(0, 2 * count, 2), n + np.arange(1, 2 * count, 2)
        picked: list[int] = []
        fixed = list(range(n))
        for _ in range(min(pairs, count)):
            left, rest = matrix, moment
            if fixed:
                inner = np.linalg.solve(matrix[np.ix_(fixed, fixed)], np.column_stack([matrix[fixed], moment[fixed]]))
                left = matrix - matrix[:, fixed] @ inner[:, :-1]
                rest = moment - matrix[:, fixed] @ inner[:, -1]
            a, b, c = left[first, first], left[first, second], left[second, second]
            x, z = rest[first], rest[second]
            # A pair that those before already span has nothing of its own to add: what is left of it is rounding.
            spanned = a + c < 1e-2 * (matrix[first, first] + matrix[second, second])
            determinant = np.maximum(a * c - b * b, 1e-12 * (np.abs(a * c) + 1e-300))
            gain = (c * x * x - 2.0 * b * x * z + a * z * z) / np.where(spanned, np.inf, determinant)
            gain[spanned] = -np.inf
            gain[picked] = -np.inf
            best = int(np.argmax(gain))
            if not np.isfinite(gain[best]):
                break
            picked.append(best)
            fixed += [n + 2 * best, n + 2 * best + 1]
        return picked


# --- families of curves of one variable, from the simplest to the finest that data can carry --------------------------


HIGHEST_ORDER = 96  # per revolution
_KNOTS = (6, 16)
LEAST_SEEN = 0.5  # of an order's amplitude that blocks must keep
LEAST_CYCLES = 1.5  # of an order within the angles covered; fewer are a smooth curve of the position


def families(values: Array) -> list[Array]:
    """Columns of a straight line, and of piecewise linear curves with more and more knots: (n, columns) each."""
    centre, scale = float(np.mean(values)), float(np.std(values)) or 1.0
    found = [np.column_stack([np.ones_like(values), (values - centre) / scale])]
    for count in _KNOTS:
        knots = quantile_knots(values, count)
        if len(knots) >= 4:
            found.append(hats(values, knots))
    return found


def quantile_knots(values: Array, count: int) -> Array:
    """Knots with as many values between any two, half of them evenly spaced so that rare extremes are seen."""
    by_rank = np.quantile(values, np.linspace(0.0, 1.0, count))
    evenly = np.linspace(values.min(), values.max(), count)
    knots = np.unique(0.5 * (by_rank + evenly))
    least = 1e-3 * (knots[-1] - knots[0])
    return knots[np.concatenate([[True], np.diff(knots) > least])]


def hats(values: Array, knots: Array) -> Array:
    """Hat functions: (n, knots), each row adds to 1."""
    at = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((values - knots[at]) / (knots[at + 1] - knots[at]), 0.0, 1.0)
    columns = np.zeros((len(values), len(knots)))
    rows = np.arange(len(values))
    columns[rows, at] = 1.0 - share
    columns[rows, at + 1] = share
    return columns


def harmonics(angle: Array, orders: NDArray[np.intp], advance: Array | None = None) -> Array:
    """Columns sin hθ, cos hθ for each order h: (n, 2·orders).

    advance: the motor's turn during a block, rad: the mean of a sine over it is smaller by sinc(h·advance/2).
    """
    columns = np.empty((len(angle), 2 * len(orders)))
    for j, h in enumerate(orders):
        share = 1.0 if advance is None else np.sinc(h * advance / (2.0 * np.pi))
        columns[:, 2 * j] = np.sin(h * angle) * share
        columns[:, 2 * j + 1] = np.cos(h * angle) * share
    return columns


def orders_in(turns: float, advance: Array | None = None) -> NDArray[np.intp]:
    """Orders that angles over so many turns can show, in blocks that advance so far (rad, each)."""
    highest = HIGHEST_ORDER
    if advance is not None:
        typical = float(np.sqrt(np.mean(advance**2)))
        kept = np.abs(np.sinc(np.arange(1, HIGHEST_ORDER + 1) * typical / (2.0 * np.pi)))
        highest = int(np.argmax(kept < LEAST_SEEN)) if np.any(kept < LEAST_SEEN) else HIGHEST_ORDER
    lowest = 1 if turns >= LEAST_CYCLES else int(np.ceil(LEAST_CYCLES / max(turns, 1e-9)))
    return np.arange(lowest, highest + 1) if lowest <= highest else np.zeros(0, np.intp)


# --- orders: how a residual repeats with each turn of the motor -------------------------------------------------------
# A part of the residual that goes A sin(h θ + φ) has the order h. The turn is seldom evenly covered, so sines and
# cosines are not orthogonal on the samples and a Fourier sum would leak between orders: all are fitted together.

_RIDGE = 1e-3  # of the number of samples: directions that the angles hardly cover do not blow up
_AROUND = 25  # orders, over which noise is as strong
_MEDIAN_CHI2 = 2.0 * np.log(2.0)  # of 2 degrees of freedom
_LEVEL = 0.01  # of recordings in which noise would show an order


@dataclass(frozen=True)
class Order:
    """A part of a residual that repeats with the motor: amplitude · sin(order · θ + phase), θ the motor's angle."""

    order: Annotated[  # whole in each turn; in 2π m of a linear axis, any number
        float, Meta(description="periods per revolution; rad/m where the motor's axis is linear")
    ]
    amplitude: Annotated[float, Meta(description="in the primary signal's unit")]
    phase: Annotated[float, as_named("phase_rad", "rad")]
    significance: float  # χ² of 2 degrees of freedom that noise of the same colour would give 2 of, on average

    def is_significant(self, tried: int = HIGHEST_ORDER, level: float = _LEVEL) -> bool:
        """Whether noise would reach this in less than `level` of the cases, with `tried` orders to choose from."""
        return self.significance > 2.0 * np.log(max(1, tried) / level)


def residual_orders(residuals: Residuals, signal: str) -> list[Order]:
    """The significant orders of a signal's residual, strongest first; none where the motor's angle is not known."""
    used = used_blocks(residuals, signal)
    angle = residuals.variables.get("motor_angle")
    if used is None or angle is None or not np.all(np.isfinite(angle[used.chosen])):
        return []
    found = orders(angle[used.chosen], used.values, residuals.turns, advance_of(residuals, used))
    return [one for one in found if one.is_significant()]


def orders(angle: Array, values: Array, turns: float, advance: Array | None = None) -> list[Order]:
    """The orders that so many turns can show, strongest first.

    angle, values: (samples,), rad and the signal's unit; advance: the turn during a sample, rad.
    """
    tried = orders_in(turns, advance)[: max(0, (len(angle) - 2) // 4)]
    if not len(tried):
        return []
    columns = np.column_stack([np.ones(len(angle)), harmonics(angle, tried, advance)])
    gram = columns.T @ columns
    scale = float(np.mean(np.diag(gram)[1:]))
    inverse = np.linalg.inv(gram + 2.0 * _RIDGE * scale * np.diag([0.0, *np.ones(2 * len(tried))]))
    coefficients = inverse @ (columns.T @ values)
    left = values - columns @ coefficients
    freedom = max(1.0, len(values) - float(np.sum(inverse * gram)))
    covariance = inverse @ gram @ inverse * max(float(left @ left) / freedom, 1e-300)
    pairs = [slice(2 * j + 1, 2 * j + 3) for j in range(len(tried))]
    white = np.array([float(coefficients[at] @ np.linalg.solve(covariance[at, at], coefficients[at])) for at in pairs])
    found = []
    for h, at, chi2 in zip(tried, pairs, white / colour(white)):
        a, b = coefficients[at]
        found.append(Order(int(h), float(np.hypot(a, b)), float(np.arctan2(b, a)), float(chi2)))
    return sorted(found, key=lambda order: -order.amplitude)


def colour(chi2: Array) -> Array:
    """How many times stronger than white noise the noise is around each order, at least 1.

    The median over neighbouring orders does not see those few that stand out.
    """
    around = median_filter(chi2, size=min(_AROUND, len(chi2)), mode="nearest")
    return np.maximum(1.0, around / _MEDIAN_CHI2)


# --- pitches: how a residual repeats along a linear motor, which has no turn that would make its orders whole ---------
# Each order alone is fitted beside a constant (Lomb and Scargle's periodogram of unevenly spaced values), on a grid
# that the travel resolves. Magnets, poles and a screw's leads stand out of it as peaks.

HIGHEST = 20_000.0  # periods in 2π m: a pitch of 0.3 mm
_PER_TRAVEL = 3.0  # orders tried for one that the travel can tell from its neighbour
_REFINED = 16  # orders tried between two neighbours about a peak
_MOST = 24  # peaks
_AT_ONCE = 2_000_000  # values × orders, which the periodogram holds in memory


def pitches(position: Array, values: Array, advance: Array | None = None) -> list[Order]:
    """The orders h of A sin(h x + φ) that the travel can show, the most significant first.

    position: (samples,), m; values: (samples,), of any unit; advance: the way during a sample, m.
    """
    known = np.isfinite(position) & np.isfinite(values)
    x, y = position[known], values[known]
    travel = float(np.ptp(x)) if x.size else 0.0
    if travel == 0.0 or np.ptp(y) == 0.0:
        return []
    y = y - np.mean(y)
    grid = np.arange(LEAST_CYCLES, min(HIGHEST, _seen_to(advance)) * travel / (2.0 * np.pi), 1.0 / _PER_TRAVEL)
    grid *= 2.0 * np.pi / travel
    if grid.size < 3:
        return []
    step = grid[1] - grid[0]
    from scipy.signal import find_peaks  # takes a third of a second to import

    chi2 = _explained(x, y, grid)
    peaks, _ = find_peaks(chi2)
    strongest = peaks[np.argsort(-chi2[peaks])[:_MOST]]
    noise = colour(chi2)
    found = []
    for at in strongest:
        near = grid[at] + step * np.linspace(-1.0, 1.0, 2 * _REFINED + 1)
        order = float(near[int(np.argmax(_explained(x, y, near)))])
        columns = np.column_stack([np.sin(order * x), np.cos(order * x), np.ones(x.size)])
        a, b, _ = np.linalg.lstsq(columns, y, rcond=None)[0]
        found.append(Order(order, float(np.hypot(a, b)), float(np.arctan2(b, a)), float(chi2[at] / noise[at])))
    return sorted(found, key=lambda one: -one.significance)


def _seen_to(advance: Array | None) -> float:
    """The highest order of which blocks that advance so far keep enough."""
    typical = 0.0 if advance is None else float(np.sqrt(np.mean(advance**2)))
    if typical == 0.0:
        return np.inf
    shares = np.linspace(0.0, 1.0, 1001)
    return float(2.0 * np.pi * shares[np.argmax(np.sinc(shares) < LEAST_SEEN)] / typical)


def _explained(x: Array, y: Array, orders: Array) -> Array:
    """χ² that a sine of each order explains, of values whose noise is what it leaves: (orders,)."""
    from scipy.signal import lombscargle

    size = max(1, _AT_ONCE // x.size)
    parts = [orders[first : first + size] for first in range(0, orders.size, size)]
    told = [lombscargle(x, y, part, normalize=True, floating_mean=True) for part in parts]
    power = np.hstack(told)  # of one order it is a number
    return x.size * power / np.maximum(1.0 - power, 1e-9)


# --- what explains a residual: curves of each variable, times a modulator, judged on parts that were left out ---------
# The residual's share that a curve tells ahead is compared between variables. Many go together — in a sine the speed
# follows from the position, the acceleration is the position turned over — so that of explanations that do equally
# well the simpler counts: the fewer knots, the plainer modulator, and the variable that an effect acts through more
# directly.

_PAIRS = (1, 3, 6)  # orders that a curve of the angle is made of
_LEAST_T = 4.0  # of the mean gain over its standard error, so that 1 % of all recordings raise a false alarm
_LEAST_T_WHITE, _LEAST_WHITE = 2.0, 30.0  # or of a gain on few stretches, with its χ² against white noise
_LEFT_OF_FLOOR = 0.3  # of the model floor's power
_LEAST_DROP = 0.014  # of χ², below which a gain is immaterial
_FAR_ABOVE = 3.0  # the noise, and its own median, from which on a model floor is left out
_SPIKE = 4.0  # of a residual's usual size
_LEAST_BLOCKS, _MOST_BLOCKS, _PIECE = 60, 40_000, 200
# What an explanation must be better by, as a share, to go before a simpler one that does as well; of gains
# below _SMALL a share of that, since a few χ² more say nothing.
_FINER, _MODULATED, _SMALL = 0.015, 0.01, 200.0
_NOT_FRICTION = 0.05  # what turns with the direction is friction, which knows speed, load and current
_BINS = 24
_LEAST_WITHIN = 0.3  # of a variable's variance, within recordings
_AT_BOUND = 0.02  # σ
_FINALISTS = 6


@dataclass(frozen=True, eq=False)
class Explanation:
    """How much of a residual one variable, times a modulator, tells ahead on data it was not fitted to.

    The residual is modulator × curve(variable); the modulator is 1, the current, or the sign of the speed.
    """

    signal: Annotated[str, Meta(description="whose residual it is")]
    variable: Annotated[str, Meta(description="motor_angle, user_position, motor_speed, acceleration, current, …")]
    modulator: Annotated[str, Meta(description="what the curve is multiplied by: 1, current or sign_speed")]
    r2: float  # cross-validated share of the residual's power as it is, noise and floor within it, at most 1
    significant: Annotated[bool, Meta(description="whether noise alone would seldom show as much")]
    centres: Array  # (bins,) of the variable, in its unit (the angle from 0 to 2π)
    curve: Array  # (bins,) mean residual over modulator, in the signal's unit (over A for the current)
    error: Array  # (bins,) its standard error
    sentence: Annotated[str, Meta(description="the same in words")]
    beyond_noise: float = 0.0  # the share of the power beyond noise and floor alone, −1 … 1

    @property
    def share(
        self,
    ) -> Annotated[
        float,
        as_named("r2", "share of the residual's power as it is, cross-validated; shares overlap", **NULL),
    ]:
        """Of the residual's power as it is, 0 … 1, as all that show it say it; what tells nothing ahead has none."""
        return min(1.0, max(0.0, self.r2))


@dataclass(frozen=True, eq=False)
class _Candidate:
    variable: str
    modulator: str
    gains: Array  # of χ², by stretch
    merit: float  # the gain, less what finer and less direct curves must be better by

    @property
    def gain(self) -> float:
        return float(self.gains.sum())

    @property
    def t(self) -> float:
        spread = float(np.std(self.gains, ddof=1)) * np.sqrt(len(self.gains))
        return self.gain / spread if spread > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class Used:
    """The blocks that count, and the residual there, in σ of the noise."""

    chosen: NDArray[np.bool_]  # (blocks,)
    values: Array  # the residual, less the model's known error
    weight: Array  # 1/σ
    folds: Folds
    given: Given  # how the model's parameters could still move it

    def without_bounded(self) -> Used:
        """The same with parameters at their bounds held there."""
        inside = np.minimum(-self.given.room[0], self.given.room[1]) > _AT_BOUND
        given = self.given
        held = Given(given.columns[:, inside], given.prior[inside], (given.room[0][inside], given.room[1][inside]))
        return replace(self, given=held)


def explain(residuals: Residuals, signal: str, axes: Axes) -> list[Explanation]:
    """Every variable × modulator that is known, the best explanation first; the simplest curve that does for each."""
    used = used_blocks(residuals, signal)
    if used is None:
        return []
    y = without_spikes(used.values * used.weight)
    inner = used.without_bounded()
    candidates = [
        candidate
        for variable in residuals.variables
        for modulator in MODULATORS
        if (candidate := _candidate(residuals, inner, y, variable, modulator)) is not None
    ]
    candidates.sort(key=lambda one: -one.merit)
    if used.given.prior.size and np.any(np.isclose(used.given.room, 0.0, atol=_AT_BOUND)):
        # With the right curve, parameters come back from bounds that they were driven to.
        finalists = [
            final
            for one in candidates[:_FINALISTS]
            if (final := _candidate(residuals, used, y, one.variable, one.modulator, bounded=True)) is not None
        ]
        candidates = sorted(finalists, key=lambda one: -one.merit) + candidates[_FINALISTS:]
    total = float(y @ y)
    whole = float(np.sum((used.values * used.weight) ** 2))  # spikes and all
    expected = float(len(y))  # of noise alone, known within √2n
    beyond = max(total - expected, 3.0 * np.sqrt(2.0 * expected))
    floor = _floor_power(residuals, signal, used)
    found = []
    for one in candidates:
        white = one.gain / max(1.0, total / expected)  # as if what is left were noise
        steady = one.t > _LEAST_T or (one.t > _LEAST_T_WHITE and white > _LEAST_WHITE)
        significant = steady and one.gain > _LEAST_DROP * total and one.gain > floor
        centres, curve, error = _binned(residuals, used, one.variable, one.modulator)
        r2 = one.gain / whole if whole > 0.0 else 0.0
        found.append(
            Explanation(
                signal=axes.signal(signal),
                variable=one.variable,
                modulator=one.modulator,
                r2=r2,
                significant=bool(significant),
                centres=centres,
                curve=curve,
                error=error,
                sentence=explanation_sentence(axes.signal(signal), one.variable, one.modulator, max(0.0, r2)),
                beyond_noise=float(np.clip(one.gain / beyond, -1.0, 1.0)),
            )
        )
    # A curve that is not significant does not go before one that is.
    return sorted(found, key=lambda one: not one.significant)


def used_blocks(residuals: Residuals, signal: str) -> Used | None:
    """Blocks that are known, not saturated and, for what drives the motor, not at rest; None where too few are.

    At rest friction holds the motor under any current up to its static limit, and where it stopped decides.
    """
    known = residuals.known.get(signal, np.zeros(residuals.blocks))
    values = residuals.values[signal] - known
    chosen = np.isfinite(values) & ~residuals.saturated
    # In transients the model's own error stands far above all else; they cannot tell.
    model = np.sqrt(np.maximum(residuals.sigma[signal] ** 2 - residuals.noise[signal] ** 2, 0.0))
    usual = float(np.median(model[chosen])) if chosen.any() else 0.0
    chosen &= np.maximum(model, np.abs(known)) <= _FAR_ABOVE * np.maximum(residuals.noise[signal], usual)
    if SIGNALS[signal].kind in ("current", "torque") and "motor_speed" in residuals.variables:
        chosen &= residuals.direction != 0.0
    if np.count_nonzero(chosen) < _LEAST_BLOCKS:
        return None
    every = -(-np.count_nonzero(chosen) // _MOST_BLOCKS)
    chosen &= (np.arange(residuals.blocks) // _PIECE) % every == 0  # of a long recording, pieces all over it
    weight = 1.0 / residuals.sigma[signal]
    folds = share_out(residuals.run[chosen], independent=residuals.is_map)
    given = nothing_given(int(chosen.sum()))
    if signal in residuals.adjustable:
        one = residuals.adjustable[signal]
        given = Given(one.columns[chosen] * weight[chosen][:, None], -one.x, one.room)
    return Used(chosen, values[chosen], weight[chosen], folds, given)


def without_spikes(values: Array) -> Array:
    """The values, cut off beyond a multiple of their usual size: a moment of a transient is not to outvote all else."""
    usual = 1.4826 * float(np.median(np.abs(values - np.median(values))))
    return np.clip(values, -_SPIKE * usual, _SPIKE * usual) if usual > 0.0 else values


def modulator_of(residuals: Residuals, name: str) -> Array | None:
    """The factor of each block; None where it is not known or the same everywhere."""
    if name == "1":
        return np.ones(residuals.blocks)
    if name == "sign_speed":
        direction = residuals.direction
        return direction if np.ptp(direction) > 0.0 else None
    current = residuals.variables.get("current")
    return current if current is not None and np.ptp(np.nan_to_num(current)) > 0.0 else None


def _candidate(
    residuals: Residuals, used: Used, y: Array, variable: str, modulator: str, *, bounded: bool = False
) -> _Candidate | None:
    """The simplest curve of a variable × modulator that does nearly as well as the best of its families."""
    factor = modulator_of(residuals, modulator)
    values = residuals.variables[variable][used.chosen]
    if factor is None or not np.all(np.isfinite(values)) or np.ptp(values) <= 1e-9 * (1.0 + np.max(np.abs(values))):
        return None
    if _tells_recordings_apart(values, residuals.recording[used.chosen]):
        return None
    if modulator == "current" and variable == "current":
        return None  # a curve of the current alone
    scale = factor[used.chosen] * used.weight
    gains = list(_by_family(residuals, used, y, values, variable, scale, bounded))
    if not gains:
        return None
    penalty = VARIABLES[variable].indirect + (_MODULATED if modulator != "1" else 0.0)
    if modulator == "sign_speed" and variable not in ("motor_speed", "load", "current"):
        penalty += _NOT_FRICTION
    totals = np.array([float(one.sum()) for one in gains])
    merits = totals - (penalty + _FINER * np.arange(len(gains))) * max(float(totals.max()), _SMALL)
    best = int(np.argmax(merits))
    return _Candidate(variable, modulator, gains[best], float(merits[best]))


def _tells_recordings_apart(values: Array, recording: NDArray[np.intp]) -> bool:
    """Whether a variable hardly varies within recordings: it then labels them, whatever differs between them."""
    count = np.bincount(recording)
    mean = np.bincount(recording, values) / np.maximum(count, 1)
    return bool(np.var(values - mean[recording]) < _LEAST_WITHIN * np.var(values))


def _by_family(
    residuals: Residuals, used: Used, y: Array, values: Array, variable: str, scale: Array, bounded: bool
) -> Iterator[Array]:
    """Gains by stretch, from the simplest family to the finest."""
    if variable != "motor_angle":
        for columns in families(values):
            yield LeftOut(columns * scale[:, None], y, used.folds, used.given).gains(bounded=bounded)
        return
    advance = advance_of(residuals, used)
    orders = orders_in(residuals.turns, advance)
    if len(orders):
        columns = harmonics(values, orders, advance)
        fit = LeftOut(columns * scale[:, None], y, used.folds, used.given)
        picked = [fit.pursue(fold, max(_PAIRS)) for fold in range(FOLDS)]
        for pairs in _PAIRS:
            choices = [
                np.array([c for pair in one[:pairs] for c in (2 * pair, 2 * pair + 1)], np.intp) for one in picked
            ]
            yield fit.gains(choices, bounded=bounded)


def advance_of(residuals: Residuals, used: Used) -> Array | None:
    """The motor's turn during a block, rad."""
    speed = residuals.variables.get("motor_speed")
    return None if speed is None else np.nan_to_num(speed[used.chosen]) * residuals.block_s


def _floor_power(residuals: Residuals, signal: str, used: Used) -> float:
    """χ² that what is left of the model floor may hold, the twins' own difference taken off."""
    model2 = (residuals.sigma[signal] ** 2 - residuals.white[signal] ** 2)[used.chosen]
    return float(_LEFT_OF_FLOOR * np.sum(model2 * used.weight**2))


def _binned(residuals: Residuals, used: Used, variable: str, modulator: str) -> tuple[Array, Array, Array]:
    """Bin centres of the variable, mean residual over modulator there, and its standard error."""
    values = residuals.variables[variable][used.chosen]
    factor = modulator_of(residuals, modulator)
    assert factor is not None
    factor = factor[used.chosen]
    if variable == "motor_angle":
        edges = np.linspace(0.0, 2.0 * np.pi, 4 * _BINS + 1)
        values = np.mod(values, 2.0 * np.pi)
    else:
        edges = quantile_knots(values, _BINS + 1)
    at = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    count = len(edges) - 1
    power = np.bincount(at, (factor * used.weight) ** 2, count)
    moment = np.bincount(at, factor * used.values * used.weight**2, count)
    filled = power > 0.0
    centres = 0.5 * (edges[1:] + edges[:-1])
    return centres[filled], moment[filled] / power[filled], 1.0 / np.sqrt(power[filled])
