"""Whether the model, with the best k and all that may move, leaves no more than noise and its own floor.

Two kinds of test.  The size of what is left, signal by signal, over what is expected.  And its shape: how much of
it lies along what missing physics would look like — periodic in the motor's angle, following speed, current,
position or their signs — beyond what the fitted numbers could take away; each such direction is a χ² test of few
degrees of freedom, far sharper than the size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator.naming import on_axes
from ema_model.estimation.floor import CORRELATED_S, silent
from ema_model.identification.fit import Fitted
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import SIGNALS as SIGNAL_NAMES

Array = NDArray[np.floating]

_SIZE = 1.3  # rms of what is left over what is expected, from which on the model has failed
_SLOW = 1.8  # the same of means over the time in which errors last
_SHAPE = 1e-5  # probability of so much along one shape in a model that fits
_ORDERS = 48  # periods in each turn of the motor, up to which its angle is looked at
_EDGE = 2.9  # σ, where a parameter stands at the edge of its tolerance


@dataclass(frozen=True)
class Adequacy:
    """The verdict on a fit."""

    adequate: bool
    ratio: float  # of what is left over what is expected, the worst of all signals and of the worst shape
    reason: str
    uninformative: bool = False  # the recordings tell nothing, whatever model they are held against


def adequacy(found: Fitted) -> Adequacy:
    """Judges a best fit."""
    name, why = silent(found.problem.model.windows, found.problem.floors)
    if why:
        title = in_sentence(SIGNAL_NAMES[name].title)
        return Adequacy(False, 1.0, f"the {title} is constant, or no larger than its floor", uninformative=True)
    sizes = _sizes(found)
    for name, (size, slow) in sizes.items():
        if size > _SIZE or slow > _SLOW:
            ratio = max(size, slow)
            title = in_sentence(SIGNAL_NAMES[name].title)
            return Adequacy(False, ratio, f"the {title} is left {ratio:.1f} × its floor")
    axes = found.problem.model.actuator.axes
    edge = [
        in_sentence(on_axes(one.name, axes).title)
        for one, x in zip(found.problem.unknowns, found.x)
        if abs(x) > _EDGE and one.is_base
    ]
    if edge:
        whose = "its" if len(edge) == 1 else "their"
        return Adequacy(False, 1.0, f"{', '.join(edge)} would have to be outside {whose} tolerance")
    shape, ratio = _worst_shape(found)
    if shape:
        return Adequacy(False, ratio, f"the residual current {shape}")
    return Adequacy(True, max(size for size, _ in sizes.values()), "")


def _sizes(found: Fitted) -> dict[str, tuple[float, float]]:
    """By signal, over all windows: rms over σ, and the same of slow means."""
    whole: dict[str, list[Array]] = {}
    means: dict[str, list[Array]] = {}
    for window, name, rows in found.problem.parts():
        values = found.residual[rows]
        count = max(1, round(CORRELATED_S / found.problem.model.windows[window].block_s))
        whole.setdefault(name, []).append(values)
        if len(values) >= 4 * count:
            folded = values[: len(values) // count * count].reshape(-1, count)
            means.setdefault(name, []).append(folded.mean(axis=1) * np.sqrt(count))
    found_sizes = {}
    for name, values in whole.items():
        slow = means.get(name)
        # The weights of the positions count a lasting error as often as it lasts already.
        slow_rms = _rms(slow) if slow and name == "current_A" else 0.0
        found_sizes[name] = (_rms(values), slow_rms)
    return found_sizes


def _rms(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _worst_shape(found: Fitted) -> tuple[str, float]:
    """The most significant shape in what is left of the current, "" if none is; and how large it is over the noise."""
    problem = found.problem
    parts = [part for part in problem.parts() if part[1] == "current_A"]
    rows = np.concatenate([np.arange(part[2].start, part[2].stop) for part in parts])
    residual = found.residual[rows]
    scale = max(1.0, float(np.sqrt(np.mean(residual**2))))
    q, _ = np.linalg.qr(found.slopes)  # the prior's rows hold back what tolerances allow
    q = q[rows]
    shapes = _shapes(found, [part[0] for part in parts])
    worst, least, size = "", _SHAPE / len(shapes), 1.0
    from scipy.special import chdtrc

    for name, columns in shapes:
        columns = columns * np.concatenate(
            [problem.over_sigma(window, "current_A", np.ones(r.stop - r.start)) for window, _, r in parts]
        )[:, None]  # fmt: skip
        own = columns - q @ (q.T @ columns)
        norm = np.linalg.norm(own, axis=0)
        kept = norm > 1e-3 * np.linalg.norm(columns, axis=0) + 1e-12
        if not kept.any():
            continue
        basis, _ = np.linalg.qr(own[:, kept] / norm[kept])
        energy = float(np.sum((basis.T @ residual) ** 2)) / scale**2
        chance = float(chdtrc(basis.shape[1], energy))
        if chance < least:
            worst, least, size = name, chance, np.sqrt(1.0 + energy / len(residual))
    return worst, float(size)


def _shapes(found: Fitted, windows: list[int]) -> list[tuple[str, Array]]:
    """What missing physics would look like in the current, by name: (blocks, few) each."""
    traces = [found.problem.simulate(found.x[None, :], i) for i in windows]
    blocks = [found.problem.model.windows[i].block_s for i in windows]

    def joined(name: str) -> Array:
        return np.concatenate([one[name][0] for one in traces])

    angle, speed, current = joined("motor_position_rad"), joined("motor_speed_rad_s"), joined("current_A")
    acceleration = np.concatenate([np.gradient(one["motor_speed_rad_s"][0], b) for one, b in zip(traces, blocks)])
    top = np.max(np.abs(speed)) + 1e-12
    sign = np.tanh(speed / (0.02 * top))
    reversal = np.exp(-((speed / (0.05 * top)) ** 2))
    shapes = [
        ("follows the motor's speed", np.stack([speed, speed * np.abs(speed)], axis=1)),
        ("follows the direction of motion", sign[:, None]),
        ("follows the size of the load", np.stack([np.abs(current) * sign, current], axis=1)),
        ("is constant", np.ones((len(speed), 1))),
        ("follows the position", np.stack([angle - angle.mean(), (angle - angle.mean()) ** 2], axis=1)),
        ("follows the acceleration", acceleration[:, None]),
        ("stands at reversals", np.stack([reversal, reversal * np.sign(acceleration)], axis=1)),
        ("changes with time", np.linspace(-1.0, 1.0, len(speed))[:, None]),
    ]
    for order in range(1, _ORDERS + 1):
        wave = np.stack([np.cos(order * angle), np.sin(order * angle)], axis=1)
        shapes.append((f"repeats {order} times a turn of the motor", wave))
        shapes.append((f"repeats {order} times a turn, in step with the current", wave * current[:, None]))
    return shapes
