"""What a comparison says beside its own sentences, in words."""

from __future__ import annotations

from ema_model.comparison.result import Compared
from ema_model.quantities.numbers import Quantity
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import SIGNALS


def held_out(one: Compared) -> str:
    """'chirp was not fitted: the equivalent current is off by 0.42 A (floor 0.31 A), …'."""
    told = []
    for name, error in one.errors.items():
        signal = SIGNALS[name]
        shown = Quantity(signal.title, signal.unit).scaled([error.rmse, error.noise_floor])
        told.append(f"{in_sentence(signal.title)} {shown.text(error.rmse)} (floor {shown.text(error.noise_floor)})")
    return f"{one.name or 'the recording'} was not fitted; the calibrated model is off by: {', '.join(told)}"
