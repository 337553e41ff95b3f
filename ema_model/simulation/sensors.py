"""What sensors do to the signals: noise and quantisation, in the recording only (the loop does not see them)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.errors import InputError
from ema_model.quantities.numbers import check_number, check_seed
from ema_model.recordings import Measurement

_USER_STEP_RAD = 1e-6


@dataclass(frozen=True)
class Sensors:
    """Accuracy of a rig's sensors; zeros are perfect ones."""

    current_noise_A: float = 0.0  # rms, white at the sample rate
    encoder_bits: int = 0  # per motor turn

    def __post_init__(self) -> None:
        check_number(self.current_noise_A, "the current noise")
        check_number(self.encoder_bits, "the encoder's bits")
        if not 0.0 <= self.current_noise_A < 1e3:
            raise InputError(f"the current noise must lie between 0 and 1000 A rms, not {self.current_noise_A:g}")
        if not 0 <= self.encoder_bits <= 32:
            raise InputError(f"the encoder must have 0 (perfect) to 32 bits, not {self.encoder_bits}")

    def record(self, measurement: Measurement, seed: int) -> Measurement:
        """The measurement as these sensors would record it; reproducible by the seed.

        InputError for a seed that is no whole number.
        """
        check_seed(seed)
        random = np.random.default_rng(seed)
        changed = {}
        if self.current_noise_A:
            for name in ("current_A", "phase_a_current_A", "phase_b_current_A", "phase_c_current_A"):
                if name in measurement:
                    true = measurement[name]
                    changed[name] = true + self.current_noise_A * random.standard_normal(len(true))
        if self.encoder_bits:
            period = measurement.sample_period_s
            steps = {"motor_position_rad": 2.0 * np.pi / 2**self.encoder_bits, "user_position_rad": _USER_STEP_RAD}
            for name, step in steps.items():
                if name in measurement:
                    changed[name] = np.round(measurement[name] / step) * step
            if {"motor_position_rad", "motor_speed_rad_s"} <= measurement.signals.keys():
                # a rig's speed is the encoder's difference
                difference = np.diff(changed["motor_position_rad"], prepend=0.0) / period
                difference[0] = measurement["motor_speed_rad_s"][0]
                changed["motor_speed_rad_s"] = difference
        return measurement.with_signals(**changed)
