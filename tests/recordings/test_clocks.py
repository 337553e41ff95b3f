"""Several clocks in one file: brought onto one by a named rule, gaps stay gaps, and the delay is told as it is."""

from __future__ import annotations

import numpy as np
import pytest
from support.representative import first_of

from ema_model.errors import InputError
from ema_model.recordings import Measurement, parse_mapping, read_side_file, side_path, write_side_file
from ema_model.recordings.health import health
from ema_model.recordings.read import read_measurement
from ema_model.recordings.side_file import SideFile
from ema_model.recordings.signals import clock_drift, speed_lag

PERIOD, N = 1e-3, 3000
POSITION, SPEED = "motor_position_rad", "motor_speed_rad_s"
MAPPING = ["time_s=t [s]", f"{POSITION}=angle [rad]", f"{SPEED}=speed [rpm]"]


def motion(seed):
    """Position and speed at any time: sines that never repeat, or a dozen moves with rests between."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        size, begin = rng.normal(size=12), np.sort(rng.uniform(0.0, N * PERIOD, 12))
        moves = [lambda t, a=a, s=s: (t - s) / 0.05 for a, s in zip(size, begin)]
        return (
            lambda t: sum(a * np.tanh(move(t)) for a, move in zip(size, moves)),
            lambda t: sum(a / 0.05 / np.cosh(np.clip(move(t), -300.0, 300.0)) ** 2 for a, move in zip(size, moves)),
        )
    turn, phase = 2.0 * np.pi * rng.uniform(0.5, 8.0, 6), rng.uniform(0.0, 6.0, 6)
    size = rng.normal(size=6) / turn
    return (
        lambda t: sum(a * np.sin(w * t + p) for a, w, p in zip(size, turn, phase)),
        lambda t: sum(a * w * np.cos(w * t + p) for a, w, p in zip(size, turn, phase)),
    )


def lag_of(position, speed, time=None):
    time = np.arange(position.size) * PERIOD if time is None else time
    return speed_lag(position, speed, time, [slice(0, position.size)])


# --- the delay -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("own_period", [PERIOD, 3.7e-3], ids=["one rate", "two rates"])
@pytest.mark.parametrize("delay", first_of([0.3 * PERIOD, 0.0, 3.0 * PERIOD, 0.02]))
def test_nine_of_ten_intervals_hold_the_delay(delay, own_period):
    """Of a coarse encoder and a noisy speed in a wrong unit; 0.82 is what 90 % of 60 fall below once in 40 times."""
    time, held, told = np.arange(N) * PERIOD, 0, 0
    own = np.arange(-2.0 * own_period, N * PERIOD + 0.01, own_period)
    for seed in range(60):
        rng, (position, speed) = np.random.default_rng(1000 + seed), motion(seed)
        angle = position(time)
        angle = np.round(angle / (2e-3 * np.ptp(angle))) * 2e-3 * np.ptp(angle)
        late = speed(own - delay)
        late = 9.55 * (late + 0.05 * np.std(late) * rng.standard_normal(own.size))
        found = lag_of(angle, np.interp(time, own, late))
        if found is not None:
            told += 1
            held += found.low_s <= delay <= found.high_s
            assert found.high_s - found.low_s < 2e-3
    assert told >= 45 and held >= 0.82 * told


def test_the_interval_is_no_wider_than_it_must_be():
    """Its half width is 1.7 times the scatter of what is found, as Student's t of some dozen blocks says."""
    time, off, half = np.arange(N) * PERIOD, [], []
    for seed in range(0, 80, 2):
        rng, (position, speed) = np.random.default_rng(seed), motion(seed)
        late = speed(time - 2e-3)
        found = lag_of(position(time), late + 0.3 * np.std(late) * rng.standard_normal(N))
        assert found is not None
        off.append(found.lag_s - 2e-3)
        half.append(0.5 * (found.high_s - found.low_s))
    assert 1.2 < np.median(half) / np.std(off) < 2.4


def test_the_lag_of_a_filter_is_told_as_one():
    time, (position, speed) = np.arange(N) * PERIOD, motion(0)
    fine = np.arange(10 * N) * PERIOD / 10.0
    filtered = np.zeros(fine.size)
    for i, value in enumerate(speed(fine)[1:]):  # of first order: its time constant less a step late
        filtered[i + 1] = filtered[i] + (value - filtered[i]) * (PERIOD / 10.0) / 2e-3
    found = health(Measurement({"time_s": time, POSITION: position(time), SPEED: filtered[::10]})).of("speed_delay")
    assert found is not None and found.sentence.endswith("delay or filter lag.") and "90 % interval" in found.sentence
    assert found.values["delay_s"] == pytest.approx(1.9e-3, rel=0.01)
    difference = np.diff(position(time), prepend=position(-PERIOD)) / PERIOD
    half_a_sample = lag_of(position(time), difference)
    assert half_a_sample is not None and half_a_sample.low_s <= 0.5 * PERIOD <= half_a_sample.high_s


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_told_without_motion(seed):
    rng, time = np.random.default_rng(seed), np.arange(N) * PERIOD
    noise = rng.standard_normal((2, N))
    assert lag_of(np.ones(N), noise[0]) is None
    assert lag_of(noise[0], noise[1]) is None
    assert lag_of(3.0 * time + 1e-3 * noise[0], 3.0 + 0.1 * noise[1]) is None  # one speed all the time
    assert lag_of(np.tanh((time - 1.0) / 0.02), 50.0 / np.cosh((time - 1.0) / 0.02) ** 2) is None  # one move


@pytest.mark.parametrize("rate", first_of([2e-4, 0.0, -1e-3]))
def test_nine_of_ten_intervals_hold_the_drift(rate):
    """Of the same sensors over 8 s; a drift that is not there is claimed once in a hundred times."""
    time, held, sure, half = np.arange(8000) * PERIOD, 0, 0, []
    own = np.arange(-3.7e-3, 8.1, 3.7e-3)
    for seed in range(0, 60, 2):
        rng, (position, speed) = np.random.default_rng(1000 + seed), motion(seed)
        angle = position(time)
        angle = np.round(angle / (2e-3 * np.ptp(angle))) * 2e-3 * np.ptp(angle)
        late = speed((own - 3e-3) / (1.0 + rate))
        late = late + 0.05 * np.std(late) * rng.standard_normal(own.size)
        found = clock_drift(angle, np.interp(time, own, late), time, [slice(0, time.size)])
        assert found is not None
        held += found.low <= rate <= found.high
        sure += found.is_sure
        half.append(0.5 * (found.high - found.low))
    assert held >= 24 and np.median(half) < 4e-5
    assert sure <= 2 if rate == 0.0 else sure >= 27


# --- of a file -------------------------------------------------------------------------------------------------------


def two_clocks(path, delay, current=False):
    """The speed, every 3 ms, comes late; a current has a third clock."""
    rng, (position, speed) = np.random.default_rng(5), motion(0)
    fast, slow = np.arange(N) * PERIOD, np.arange(N // 3) * 3.0 * PERIOD
    channels = [
        ("angle [rad]", fast, np.round(position(fast), 4)),
        ("speed [rpm]", slow, speed(slow - delay) * 30.0 / np.pi + 0.05 * rng.standard_normal(slow.size)),
        *([("iq [A]", slow + 1e-4, np.sin(slow))] if current else []),
    ]
    columns = [[f"{value:.9g}" for value in values] for _, *both in channels for values in both]
    rows = [";".join(column[i] if i < len(column) else "" for column in columns) for i in range(N)]
    path.write_text("\n".join([";".join(f"t [s];{name}" for name, *_ in channels), *rows]))
    return path


@pytest.mark.parametrize("delay", [0.005, -0.0114, 0.0])
def test_a_file_with_a_late_clock(delay, tmp_path):
    measurement = read_measurement(two_clocks(tmp_path / "two.csv", delay), MAPPING)
    card = health(measurement)
    found, clocks = card.of("speed_delay"), card.of("clocks")
    assert found is not None and found.values["delay_low_s"] <= delay <= found.values["delay_high_s"]
    assert clocks is not None and "2 clocks" in clocks.sentence and "linearly between their samples" in clocks.sentence
    assert "motor speed" in clocks.sentence and "motor position" not in clocks.sentence
    assert card.of("clock_delay") is None and found.severity == ("warning" if delay else "good")
    assert ("takes it out" in found.sentence) == (delay != 0.0)


def test_what_the_card_says_to_do_takes_the_delay_out(tmp_path):
    path = two_clocks(tmp_path / "two.csv", 0.005)
    found = health(read_measurement(path, MAPPING)).of("speed_delay")
    assert found is not None
    advised = found.sentence.split('--map "')[1].split('"')[0]
    assert advised.startswith(f"{SPEED}={SPEED}[delay_s=0.00")  # of a file read without its mapping
    late = f"delay_s={advised.split('delay_s=')[1]}"
    texts = [*MAPPING[:2], f"{SPEED}=speed [rpm][rpm, {late}"]
    by_hand = read_measurement(path, texts)
    side = SideFile(mapping=parse_mapping(texts, ["t [s]", "angle [rad]", "speed [rpm]"]))
    write_side_file(side, side_path(path))
    assert read_side_file(side_path(path)) == SideFile(mapping=side.mapping, path=str(side_path(path)))
    moved = read_measurement(path)
    np.testing.assert_array_equal(moved[SPEED], by_hand[SPEED])
    again = health(moved).of("speed_delay")
    assert again is not None and again.severity == "good" and abs(again.values["delay_s"]) < 1e-4
    assert any("moved" in note and "back" in note for note in moved.notes)
    assert moved.time_s[-1] < (N - 3) * PERIOD - 4e-3  # the end, of which no late speed is known


def test_clocks_that_do_not_run_alike(tmp_path):
    time, own, (position, speed) = np.arange(8000) * PERIOD, np.arange(2650) * 3.0 * PERIOD, motion(0)
    for drift in (0.0, 5e-4):
        columns = [time, position(time), own, speed(own / (1.0 + drift))]
        columns = [[f"{value:.9g}" for value in values] for values in columns]
        rows = [";".join(column[i] if i < len(column) else "" for column in columns) for i in range(time.size)]
        (tmp_path / "two.csv").write_text("\n".join(["t [s];angle [rad];t [s];speed [rad/s]", *rows]))
        mapping = ["time_s=t [s]", f"{POSITION}=angle [rad]", f"{SPEED}=speed [rad/s]"]
        found = health(read_measurement(tmp_path / "two.csv", mapping)).of("clock_drift")
        if not drift:
            assert found is None
            continue
        assert (
            found is not None
            and found.severity == "warning"
            and "ppm fast against the motor position" in (found.sentence)
        )
        assert found.values["rate_low"] <= drift <= found.values["rate_high"]


def test_what_cannot_be_known_is_said(tmp_path):
    path = two_clocks(tmp_path / "three.csv", 0.005, current=True)
    card = health(read_measurement(path, [*MAPPING, "current_A=iq [A]"]))
    unknown, told = card.of("clock_delay"), card.of("speed_delay")
    assert unknown is not None and "equivalent current is not known" in unknown.sentence and told is not None
    alone = health(read_measurement(path, [*MAPPING[:2], "current_A=iq [A]"]))
    assert alone.of("clock_delay") is not None and alone.of("speed_delay") is None
    one = health(read_measurement(path, MAPPING[:2]))
    assert one.of("clock_delay") is None and one.of("clocks") is None  # all that is read has one clock


@pytest.mark.parametrize("text", ["time_s=t[s, delay_s=1]", "segment=t[delay_s=0.1]", "current_A=t[A, delay_s=nan]"])
def test_delays_that_are_none(text):
    with pytest.raises(InputError, match="delay_s must be a number of seconds"):
        parse_mapping([text])


# --- one clock -------------------------------------------------------------------------------------------------------


def mdf(path, groups):
    """A group for each clock."""
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for time, channels in groups:
            file.append([asammdf.Signal(v, time, name=name, unit=unit) for (name, unit), v in channels.items()])
        file.save(path, overwrite=True)
    return path


def test_gaps_stay_gaps_states_hold_and_counts_do_not(tmp_path):
    fast, slow = np.arange(2000) * 1e-3, np.arange(500) * 4e-3
    kept = (slow < 0.8) | (slow > 1.2)
    rows = {
        ("counts", ""): np.round(1e4 * slow[kept]).astype(np.int32),
        ("on", ""): (slow[kept] > 0.5).astype(np.uint8),
        ("iq", "A"): slow[kept],
    }
    path = mdf(tmp_path / "gap.mf4", [(fast, {("angle", "rad"): np.sin(fast)}), (slow[kept], rows)])
    mapping = ["time_s=time_s", "command_rad=angle [rad]", "current_A=iq [A]", "drive_enabled=on"]
    measurement = read_measurement(path, [*mapping, f"{POSITION}=counts[rad]"])
    time = measurement.time_s
    assert not np.any((time > 0.81) & (time < 1.19))
    np.testing.assert_allclose(measurement["current_A"], time, atol=1e-9)
    np.testing.assert_allclose(measurement[POSITION], 1e4 * time, atol=1.0)  # half a step late were 20
    assert set(measurement["drive_enabled"]) == {0.0, 1.0}
    assert any("linearly between their samples, states held" in note for note in measurement.notes)
    found = health(measurement).of("gaps")
    assert (
        found is not None and found.values["gaps"] == 1.0 and found.values["longest_s"] == pytest.approx(0.4, abs=0.01)
    )
    assert len(measurement.runs) == 2 and measurement.is_uniform
    again = measurement.resampled(2e-3)
    assert not np.any((again.time_s > 0.81) & (again.time_s < 1.19))


def test_a_state_logged_where_it_changes_has_no_gaps(tmp_path):
    fast, changes = np.arange(2000) * 1e-3, np.array([0.0, 0.01, 0.03, 0.04, 1.2, 1.9])
    state = {("on", ""): np.array([0, 1, 0, 1, 0, 1], np.uint8)}
    path = mdf(tmp_path / "state.mf4", [(fast, {("angle", "rad"): np.sin(fast)}), (changes, state)])
    measurement = read_measurement(path, ["time_s=time_s", "command_rad=angle [rad]", "drive_enabled=on"])
    assert measurement.samples == fast.size
    on = ((fast >= 0.01) & (fast < 0.03)) | ((fast >= 0.04) & (fast < 1.2)) | (fast >= 1.9)
    np.testing.assert_array_equal(measurement["drive_enabled"], on)


def test_a_state_of_a_text_holds_too(tmp_path):
    fast, slow = np.arange(800) * 1e-3, np.arange(100) * 8e-3
    rows = [
        f"{t:.3f};{np.sin(t):.6f};" + (f"{slow[i]:.3f};{int(slow[i] > 0.3)}" if i < 100 else ";")
        for i, t in enumerate(fast)
    ]
    path = tmp_path / "state.csv"
    path.write_text("\n".join(["t [s];angle [rad];t [s];on", *rows]))
    measurement = read_measurement(path, ["time_s=t [s]", "command_rad=angle [rad]", "drive_enabled=on"])
    assert set(measurement["drive_enabled"]) == {0.0, 1.0}


@pytest.mark.parametrize("begin", ["12:00:00.250", "11:59:59.900"])
def test_stamps_of_two_clocks_count_from_one_moment(begin, tmp_path):
    """A channel that began a quarter of a second later is not moved to the start of the other."""
    first = np.datetime64("2024-05-01T12:00:00.000")
    second = np.datetime64(f"2024-05-01T{begin}")
    steps = np.arange(1000)
    shift = (second - first) / np.timedelta64(1, "s")
    rows = []
    for i in steps:
        stamps = [str(one + np.timedelta64(int(2 * i), "ms")).replace("T", " ") for one in (first, second)]
        rows.append(f"{stamps[0]};{2e-3 * i:.4f};{stamps[1]};{2e-3 * i + shift:.4f}")
    path = tmp_path / "stamps.csv"
    path.write_text("\n".join(["time;angle [rad];time;current [A]", *rows]))
    measurement = read_measurement(path, ["time_s=time [s]", "command_rad=angle [rad]", "current_A=current [A]"])
    np.testing.assert_allclose(measurement["current_A"], measurement["command_rad"], atol=1e-6)
    assert measurement.samples == pytest.approx(1000 - abs(shift) / 2e-3, abs=2)


def test_samples_that_come_when_they_like_are_one_run():
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.exponential(1e-3, 2000) ** 2 * 1e3 + 1e-9)
    assert len(Measurement({"time_s": time, "duty": time}).runs) == 1
