"""What is left between recordings and the model, beside the variables that may explain it.

Everything stands on short blocks, the ones that the model was fitted on.  Their means take the inverter's
ripple away (MODEL §2) and make the noise of a 10 kHz recording √5 times smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STILL = 1e-3  # of the largest speed, below which the motor counts as standing


@dataclass(frozen=True, eq=False)
class Adjustable:
    """How the model's parameters could still move a signal, to first order, in σ of their tolerances.

    An explanation must tell more than they can: what a parameter within its tolerance does equally well is no
    missing physics.
    """

    columns: Array  # (blocks, unknowns), ∂signal/∂x
    x: Array  # (unknowns,), where they stand; the prior pulls them to 0
    room: tuple[Array, Array]  # (unknowns,) each, how far they may still go down and up


@dataclass(frozen=True, eq=False)
class Residuals:
    """Measurement minus model, by signal, per block, of one recording or of several joined; arrays are (blocks,).

    `variables` has those of `quantities.variables` that are known, in their units: the motor's angle not wrapped, the
    acceleration the motor's, the load at the user, the time since the recording's start.  A value that a recording
    does not have is NaN; so is a residual that a recording lacks.
    """

    time_s: Array
    values: dict[str, Array]
    sigma: dict[str, Array]  # standard deviation that a perfect model would leave: noise and model floor
    noise: dict[str, Array]  # the sensor noise's part of it
    white: dict[str, Array]  # and of that, what lasts no longer than a sample
    variables: dict[str, Array]
    recording: NDArray[np.intp]  # which of the joined recordings, from 0
    run: NDArray[np.intp]  # which run; time is continuous within one, and no run crosses recordings
    saturated: NDArray[np.bool_]  # the drive stands at its current or voltage limit: not to be counted
    block_s: float  # the blocks' length, s (the longest of the recordings')
    torque_constant: float | None = None  # N·m/A (N/A) of the motor, where current can be read as torque
    known: dict[str, Array] = field(default_factory=dict)  # the model's error that its three-phase twin shows
    adjustable: dict[str, Adjustable] = field(default_factory=dict)  # by signal, where it was fitted
    counts: Array | None = None  # how much each block counts in a mean over time; all alike without it
    alike: Array | None = None  # over how many blocks the white noise stays alike; over one without it
    is_map: bool = False  # a static map: blocks are independent and have no time

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.time_s)

    @property
    def direction(self) -> Array:
        """Sign of the motor's speed, (blocks,); 0 where it stands or is not known."""
        speed = self.variables.get("motor_speed")
        if speed is None:
            return np.zeros(self.blocks)
        speed = np.nan_to_num(speed)
        return np.where(np.abs(speed) <= _STILL * np.max(np.abs(speed), initial=0.0), 0.0, np.sign(speed))

    @property
    def turns(self) -> float:
        """Turns of the motor between its lowest and highest angle; 0 where it is not known."""
        angle = self.variables.get("motor_angle")
        known = np.zeros(0) if angle is None else angle[np.isfinite(angle)]
        return float(np.ptp(known)) / (2.0 * np.pi) if known.size else 0.0


def join(parts: Sequence[Residuals]) -> Residuals:
    """Stretches of one actuator's recordings, one after another."""
    if len(parts) == 1:
        return parts[0]

    def together(name: str, missing: float = np.nan) -> dict[str, Array]:
        keys = dict.fromkeys(key for part in parts for key in getattr(part, name))
        return {
            key: np.concatenate([getattr(part, name).get(key, np.full(part.blocks, missing)) for part in parts])
            for key in keys
        }

    first_run = np.cumsum([0, *(int(part.run.max(initial=-1)) + 1 for part in parts[:-1])])
    return Residuals(
        time_s=np.concatenate([part.time_s for part in parts]),
        values=together("values"),
        sigma=together("sigma"),
        noise=together("noise"),
        white=together("white"),
        variables=together("variables"),
        recording=np.concatenate([part.recording for part in parts]),
        run=np.concatenate([part.run + first for part, first in zip(parts, first_run)]),
        saturated=np.concatenate([part.saturated for part in parts]),
        block_s=max(part.block_s for part in parts),
        torque_constant=parts[0].torque_constant,
        known=together("known", 0.0),
        counts=np.concatenate([np.ones(part.blocks) if part.counts is None else part.counts for part in parts]),
        alike=np.concatenate([np.ones(part.blocks) if part.alike is None else part.alike for part in parts]),
        is_map=all(part.is_map for part in parts),
    )
