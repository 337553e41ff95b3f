"""A comparison put together without calibration or search: a noisy three-phase actuator with cogging against the
Monitor Model, so that what shows comparisons can be tested on its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from ema_model.actuator import Actuator, load_actuator
from ema_model.commands import command
from ema_model.comparison.explain import Explanation, Order
from ema_model.comparison.regions import Region
from ema_model.comparison.residuals import OverFloor, Residuals, join
from ema_model.comparison.result import Compared, Comparison, SignalError
from ema_model.estimation.calibrate import Calibrated, Calibration
from ema_model.quantities import unit_of
from ema_model.recordings.health import health
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

SIGNALS = ("current_A", "motor_position_rad", "user_position_rad")
PER_BLOCK = 5
NOISE_A = 0.45
BAND = (0.95, 1.05)
AT_BOUND = "motor.inertia_kgm2"


def comparison(
    names: Sequence[str] = ("bench run",), duration_s: float = 1.0, amplitude_Nm: float = 0.02, calibrated: bool = True
) -> Comparison:
    """One recording for each name; the model file is a little wrong where it is "calibrated"."""
    actuator = load_actuator()
    before = (
        actuator.with_values({"motor.viscous_friction_Nms_rad": 1.2 * actuator.motor.viscous_friction_Nms_rad})
        if calibrated
        else actuator
    )
    parts = [_recording(name, i, actuator, before, duration_s, amplitude_Nm) for i, name in enumerate(names)]
    residuals = join([residuals for _, residuals in parts])
    recordings = [one for one, _ in parts]
    errors = {name: _over_all(recordings, name) for name in SIGNALS}
    angle, current = residuals.variables["motor_angle"], residuals.values["current_A"]
    return Comparison(
        over_floor=float(np.sqrt(np.mean([errors[name].in_floors.error ** 2 for name in SIGNALS]))),
        floor_band=BAND,
        actuator=before,
        calibration=_calibration(before, actuator, recordings) if calibrated else None,
        recordings=recordings,
        residuals=residuals,
        signals=errors,
        primary="current_A",
        explained_by=_explanations(),
        orders=_orders(angle, current),
        worst_regions=[_by_angle(residuals), _by_speed(residuals)],
        adequate=errors["current_A"].rmse < 1.2 * errors["current_A"].noise_floor,
        sentences=("The residual current repeats with the motor's angle.", "It repeats 12 times a turn."),
        warnings=(f"{AT_BOUND} stands at its bound.",) if calibrated else (),
    )


def _recording(
    name: str, number: int, actuator: Actuator, before: Actuator, duration_s: float, amplitude_Nm: float
) -> tuple[Compared, Residuals]:
    run = Run(command("sine", {"amplitude_rad": 0.03 - 0.005 * number, "frequency_Hz": 3.0}), duration_s)
    cogging = {"cogging_torque": {"amplitude_Nm": amplitude_Nm, "order": 12.0}}
    measurement = Sensors(NOISE_A, 12).record(simulate_reference(run, actuator, effects=cogging), seed=number)
    measurement = replace(measurement, name=name)
    pairs = ((simulate_reference, actuator), (simulate_monitor, actuator), (simulate_monitor, before))
    twin, model, initial = (simulate(run, one) for simulate, one in pairs)
    blocks = (measurement.samples - 1) // PER_BLOCK

    def means(values: np.ndarray) -> np.ndarray:
        return values[1 : 1 + blocks * PER_BLOCK].reshape(blocks, PER_BLOCK).mean(axis=1)

    noise = {"current_A": NOISE_A, "motor_position_rad": 2e-3, "user_position_rad": 1e-6}
    white = {signal: np.full(blocks, noise[signal] / np.sqrt(PER_BLOCK)) for signal in SIGNALS}
    apart = {signal: (means(twin[signal]) - means(model[signal])) ** 2 for signal in SIGNALS}
    sigma = {s: np.hypot(white[s], np.sqrt(uniform_filter1d(apart[s], 51, mode="nearest"))) for s in SIGNALS}
    shown = [{s: means(m[s]) for s in SIGNALS} for m in (measurement, initial, model)]
    measured, first, last = shown
    time, speed = means(measurement.time_s), means(model["motor_speed_rad_s"])
    residuals = Residuals(
        time_s=time,
        values={s: measured[s] - last[s] for s in SIGNALS},
        sigma=sigma,
        noise=white,
        white=white,
        variables={
            "motor_angle": last["motor_position_rad"],
            "user_position": last["user_position_rad"],
            "motor_speed": speed,
            "acceleration": np.gradient(speed, time),
            "current": last["current_A"],
            "time": time,
        },
        recording=np.full(blocks, number),
        run=np.zeros(blocks, np.intp),
        saturated=np.zeros(blocks, bool),
        block_s=PER_BLOCK * measurement.sample_period_s,
        torque_constant=actuator.motor.torque_constant_Nm_A,
    )
    errors = {s: _error(measured[s], first[s], last[s], sigma[s]) for s in SIGNALS}
    return Compared(name, measurement, health(measurement), time, *shown, sigma, errors), residuals


def _error(measured: np.ndarray, initial: np.ndarray, model: np.ndarray, sigma: np.ndarray) -> SignalError:
    left = measured - model
    return SignalError(
        rmse=_rms(left),
        rmse_initial=_rms(measured - initial),
        nrmse=_rms(left) / float(np.ptp(measured)),
        noise_floor=_rms(sigma),
        mean_absolute=float(np.mean(np.abs(left))),
        in_floors=OverFloor(_rms(left / sigma), BAND),
    )


def _over_all(recordings: Sequence[Compared], name: str) -> SignalError:
    together = [np.concatenate([getattr(one, what)[name] for one in recordings]) for what in _WHAT]
    return _error(*together)


_WHAT = ("measured", "initial", "model", "sigma")


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _orders(angle: np.ndarray, current: np.ndarray) -> list[Order]:
    """The strong ones of 40, by least squares."""
    waves = [wave(h * angle) for h in range(1, 41) for wave in (np.sin, np.cos)]
    fitted, *_ = np.linalg.lstsq(np.stack(waves, axis=1), current, rcond=None)
    pairs = fitted.reshape(-1, 2)
    sizes = np.hypot(*pairs.T)
    error = np.std(current) * np.sqrt(2.0 / len(current))
    found = [
        Order(h + 1, float(sizes[h]), float(np.arctan2(*pairs[h, ::-1])), float((sizes[h] / error) ** 2))
        for h in range(40)
    ]
    return sorted((order for order in found if order.amplitude > 4.5 * error), key=lambda order: -order.amplitude)


def _explanations() -> list[Explanation]:
    none = np.zeros(0)
    told = (
        ("motor_angle", "1", 0.83, True, "The residual current repeats with the motor's angle."),
        ("motor_angle", "current", 0.12, False, "With the current, the motor's angle tells little."),
        ("motor_speed", "1", 0.05, False, "The speed tells little."),
        ("current", "sign_speed", 0.21, True, "The residual current grows with the current, against the motion."),
        ("acceleration", "1", -0.02, False, "The acceleration tells nothing."),
    )
    return [Explanation("current_A", v, m, r2, sure, none, none, none, text, r2) for v, m, r2, sure, text in told]


def _by_angle(residuals: Residuals) -> Region:
    low, high = np.radians(40.0), np.radians(55.0)
    turn = np.mod(residuals.variables["motor_angle"], 2.0 * np.pi)
    text = "Between 40° and 55° of the motor's turn the motor needs 18 mN·m less than the model."
    return _region(residuals, "motor_angle", low, high, (turn >= low) & (turn < high), text)


def _by_speed(residuals: Residuals) -> Region:
    speed = residuals.variables["motor_speed"]
    low, high = 0.8 * float(speed.max()), float(speed.max())
    text = f"The motor needs 3 mN·m more near {high:.0f} rad/s than the model."
    return _region(residuals, "motor_speed", low, high, speed >= low, text)


def _region(residuals: Residuals, variable: str, low: float, high: float, blocks: np.ndarray, text: str) -> Region:
    inside = residuals.values["current_A"][blocks]
    excess = _rms(inside) / _rms(residuals.sigma["current_A"][blocks])
    return Region("current_A", variable, low, high, _rms(inside), float(inside.mean()), excess, text, blocks)


def _calibration(before: Actuator, after: Actuator, recordings: Sequence[Compared]) -> Calibration:
    parameters = {}
    for path, tolerance in before.tolerances.items():
        if tolerance.free:
            z = (after.value(path) - before.value(path)) / tolerance.sigma
            parameters[path] = _calibrated(before, path, z)
    parameters[AT_BOUND] = _calibrated(before, AT_BOUND, 3.0)
    start = Calibrated(value=1e-4, initial=0.0, interval90=(-1e-4, 3e-4), unit="rad", z=0.05, at_bound=False)
    return Calibration(
        converged=True,
        parameters=parameters,
        starts={f"turned {i}": start for i in range(len(recordings))},
        actuator=after,
        k=np.zeros(8),
        residual=np.zeros(0),
        chi2_per_value=1.3,
        covariance_scale=1.3,
        signals=[one.model for one in recordings],
        before=[one.initial for one in recordings],
        sensitivities=[],
        weighted_sensitivities=[],
        x=np.zeros(0),
        room=(np.zeros(0), np.zeros(0)),
        evaluations=12,
        confounded=(("motor.static_friction_Nm", "motor.dynamic_friction_Nm"),),
        identifiable=(),
        free=tuple(parameters),
    )


def _calibrated(before: Actuator, path: str, z: float) -> Calibrated:
    sigma = before.tolerances[path].sigma
    value, half = before.value(path) + z * sigma, 0.4 * sigma
    return Calibrated(
        value=value,
        initial=before.value(path),
        interval90=(value - half, value + half),
        unit=unit_of(path),
        z=z,
        at_bound=abs(z) > 2.99,
    )
