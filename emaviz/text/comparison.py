"""What a comparison says beside its own sentences, in words."""

from __future__ import annotations

from ema_model.comparison.result import Compared
from ema_model.quantities.axes import ROTARY
from ema_model.quantities.shown import of_signal
from ema_model.quantities.titles import in_sentence


def held_out(one: Compared) -> str:
    """'chirp was not fitted: the equivalent current is off by 0.42 A (floor 0.31 A), …'."""
    told = []
    for name, error in one.errors.items():
        shown = error.quantity(of_signal(name, ROTARY))  # by the name in files, which says all
        told.append(f"{in_sentence(shown.title)} {shown.text(error.rmse)} (floor {shown.text(error.noise_floor)})")
    return f"{one.name or 'the recording'} was not fitted; the calibrated model is off by: {', '.join(told)}"
