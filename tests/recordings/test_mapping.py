"""Columns of many rigs, guessed by name and unit; the text form of a mapping; units; the mapped numbers."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ema_model.errors import InputError
from ema_model.recordings import SIGNALS, ColumnMapping, MappedColumn, apply_mapping, guess_mapping, parse_mapping
from ema_model.recordings.column_mapping import doubt
from ema_model.recordings.column_names import UNITS, find_unit
from ema_model.recordings.read import read_measurement

# header: the signal of each column in its order, with the unit where it is not the signal's own; - is left aside
HEADERS = {
    "t_s,q_goal_rad,q_rad,dq_rad_s,duty,vin_V,temp_C,torque_enable": "time_s command_rad user_position_rad "
    "motor_speed_rad_s duty bus_voltage_V temperature_C drive_enabled",
    "run,iq_set_A,t_s,theta_rad,iq_A": "segment - time_s motor_position_rad current_A",
    "theta_rad,iq_A": "motor_position_rad current_A",
    # Dynamixel
    "timestamp,goal_position,present_position,present_velocity,present_current,present_pwm,present_input_voltage,"
    "present_temperature": "time_s command_rad user_position_rad motor_speed_rad_s current_A duty bus_voltage_V "
    "temperature_C",
    "Time [ms],Goal Position [deg],Present Position [deg],Present Velocity [rpm],Present Current [mA]": "time_s:ms "
    "command_rad:deg user_position_rad:deg motor_speed_rad_s:rpm current_A:mA",
    "sec,Position (counts),Velocity (counts/s),Current (mA),PWM (%)": "time_s motor_position_rad:counts/4096 "
    "motor_speed_rad_s:counts/4096/s current_A:mA duty:%",
    # ODrive
    "timestamp_ms,pos_estimate_turns,vel_estimate_turns_s,iq_measured_A,iq_setpoint_A,vbus_voltage_V": "time_s:ms "
    "motor_position_rad:turn motor_speed_rad_s:rev/s current_A - bus_voltage_V",
    "t,encoder.pos_estimate,encoder.vel_estimate,motor.current_control.Iq_measured,vbus_voltage": "time_s "
    "motor_position_rad motor_speed_rad_s current_A bus_voltage_V",
    "time,controller.input_pos [turns],encoder.pos_estimate [turns],Iq_measured [A]": "time_s command_rad:turn "
    "motor_position_rad:turn current_A",
    # dSPACE and Simulink
    "Time,Model Root/Motor/theta_m[rad],Model Root/Motor/omega_m[rad/s],Model Root/i_q[A],Model Root/T_load[Nm]": (
        "time_s motor_position_rad motor_speed_rad_s current_A load_torque_Nm"
    ),
    "t[s];theta_cmd[rad];theta_u[rad];theta_m[rad];omega_m[rad/s];I_eq[A]": "time_s command_rad user_position_rad "
    "motor_position_rad motor_speed_rad_s current_A",
    "Time [s],Theta Ref [deg],Theta Meas [deg],Speed [RPM],Torque [N.m],Coil Temperature [degC]": "time_s "
    "command_rad:deg user_position_rad:deg motor_speed_rad_s:rpm motor_torque_Nm temperature_C",
    "timeStamp,desiredPosition,actualPosition,actualVelocity,motorCurrent,motorTemperature": "time_s command_rad "
    "user_position_rad motor_speed_rad_s current_A temperature_C",
    # German
    "Zeit [s];Sollwinkel [°];Istwinkel [°];Motordrehzahl [1/min];Motorstrom [A];Lastmoment [Nm]": "time_s "
    "command_rad:deg user_position_rad:deg motor_speed_rad_s:rpm current_A load_torque_Nm",
    "Zeit [ms];Position Soll [mm];Position Ist [mm];Geschwindigkeit [mm/s];Motorkraft [N];Lastkraft [kN]": "time_s:ms "
    "command_m:mm user_position_m:mm motor_speed_m_s:mm/s motor_force_N load_force_N:kN",
    "Zeit_s,Drehmoment_Nm,Drehzahl_rpm,Strom_A,Temperatur_C,Zwischenkreisspannung_V": "time_s motor_torque_Nm "
    "motor_speed_rad_s:rpm current_A temperature_C bus_voltage_V",
    "Zeit (ms);Winkelgeschwindigkeit (rad/s);Drehwinkel (°);Störmoment (Nm)": "time_s:ms motor_speed_rad_s "
    "motor_position_rad:deg load_torque_Nm",
    # plain ones
    "time_ms,cmd_deg,pos_deg,speed_rpm,current_mA": "time_s:ms command_rad:deg user_position_rad:deg "
    "motor_speed_rad_s:rpm current_A:mA",
    "time_us,setpoint_counts,encoder_counts,current_mA": "time_s:us command_rad:counts/4096 "
    "motor_position_rad:counts/4096 current_A:mA",
    "elapsed (s),command (deg),output angle (deg),motor angle (deg),motor speed (rpm),motor current (A)": "time_s "
    "command_rad:deg user_position_rad:deg motor_position_rad:deg motor_speed_rad_s:rpm current_A",
    "time (sec),ref_position_rad,position_rad,velocity_rad_per_s,torque_Nm,enable": "time_s command_rad "
    "user_position_rad motor_speed_rad_s motor_torque_Nm drive_enabled",
    "Time_ns,joint_position_deg,joint_velocity_deg_s,motor_current_A,supply_voltage_V": "time_s:ns "
    "user_position_rad:deg user_speed_rad_s:deg/s current_A bus_voltage_V",
    "time_s,trial,angle_deg,torque_mNm,T_winding_C": "time_s segment motor_position_rad:deg motor_torque_Nm:mNm "
    "temperature_C",
    "timestamp [us],shaft encoder [ticks],bus current [A],q current [A],dc link voltage [V]": "time_s:us "
    "motor_position_rad:counts/4096 - current_A bus_voltage_V",
    "time_s,max_current_A,notes,id_A,iq_A": "time_s - - - current_A",
    # phase currents
    "time_s,i_a,i_b,i_c,theta_m,omega_m": "time_s phase_a_current_A phase_b_current_A phase_c_current_A "
    "motor_position_rad motor_speed_rad_s",
    "time_s,Ia [mA],Ib [mA],Ic [mA],rotor angle [deg]": "time_s phase_a_current_A:mA phase_b_current_A:mA "
    "phase_c_current_A:mA motor_position_rad:deg",
    "t_s,i_u_A,i_v_A,i_w_A,motor_angle_rad": "time_s phase_a_current_A phase_b_current_A phase_c_current_A "
    "motor_position_rad",
    # linear axes
    "time_s,command_m,user_position_m,motor_position_m,motor_speed_m_s,motor_force_N,load_force_N": "time_s command_m "
    "user_position_m motor_position_m motor_speed_m_s motor_force_N load_force_N",
    "time,x_cmd_mm,x_mm,v_mm_s,motor_force_N,load_force_N": "time_s command_m:mm user_position_m:mm "
    "motor_speed_m_s:mm/s motor_force_N load_force_N",
    "t_s,stroke_mm,rod_force_kN,iq_A,load [N]": "time_s motor_position_m:mm motor_force_N:kN current_A load_force_N",
    "time_s,position command [m],position [m],motor speed [m/s],external force [N]": "time_s command_m user_position_m "
    "motor_speed_m_s load_force_N",
}


@pytest.mark.parametrize("header", HEADERS)
def test_headers_of_rigs(header):
    columns = header.split(";" if ";" in header else ",")
    expected = {}
    for column, text in zip(columns, HEADERS[header].split(), strict=True):
        signal, _, unit = text.partition(":")
        if signal != "-":
            expected[signal] = (column, unit)
    mapping = guess_mapping(columns, counts_per_turn=4096)
    found = {entry.signal: (entry.column, "" if entry.converter.is_si else entry.unit) for entry in mapping.entries}
    assert {signal: column for signal, (column, _) in found.items()} == {
        s: column for s, (column, _) in expected.items()
    }
    for signal, (_, unit) in expected.items():
        dimension = SIGNALS[signal].unit
        assert find_unit(found[signal][1] or dimension, dimension) == find_unit(unit or dimension, dimension)
    assert all(0.0 < entry.confidence <= 1.0 and entry.reason for entry in mapping.entries)
    left = {column for column, reason in mapping.unmapped if reason}
    assert left == set(columns) - {column for column, _ in expected.values()}
    # What is shown to the user can be given on the command line.
    parsed = parse_mapping(mapping.texts, columns)
    assert [(e.signal, e.column, e.converter) for e in parsed.entries] == [
        (e.signal, e.column, e.converter) for e in mapping.entries
    ]


def test_every_canonical_name_is_its_own_signal():
    mapping = guess_mapping(list(SIGNALS))
    assert [(entry.signal, entry.column, entry.unit) for entry in mapping.entries] == [(n, n, "") for n in SIGNALS]


def test_numbers_tell_what_names_leave_open():
    count = np.arange(200.0)
    milliseconds = guess_mapping({"time": 4.0 * count, "pwm": 50.0 * np.sin(count), "temp": 300.0 + count / 100.0})
    assert [entry.unit for entry in milliseconds.entries] == ["ms", "%", "K"]
    plain = guess_mapping({"time": count / 200.0, "pwm": 0.5 * np.sin(count), "temp": 30.0 + count / 100.0})
    assert [entry.unit for entry in plain.entries] == ["", "", ""]
    falling = guess_mapping({"time": -count, "iq_A": count}).get("time_s")
    assert falling is None or (falling.confidence < 0.5 and "does not increase" in falling.reason)
    assert guess_mapping({"angle_counts": count}).entries == ()  # of how many a turn?
    assert "counts per turn" in guess_mapping(["angle_counts"]).unmapped[0][1]


UNSURE = {  # header: why, by signal; the others are sure
    "t [s],set [deg],motor angle [deg],rotor position [deg]": {
        "motor_position_rad": "'rotor position [deg]' may be it as well"
    },
    "t [s],goal_position,iq [A],motor current [A]": {"command_rad": "it has no unit"},
    "t,iq [A],speed": {"motor_speed_rad_s": "it has no unit"},
    "t [s],cmd [deg],pos_1 [deg],pos_2 [deg]": {
        "user_position_rad": "'pos_2 [deg]' may be it as well",
        "motor_position_rad": "'pos 2' is a position",
    },
    "t [s],q_rad_1,q_rad_2,tau_Nm_1": {"motor_position_rad": "'q_rad_2' may be it", "user_position_rad": "a position"},
    "t [s],pos [deg],ia [A],ib [A]": {
        "phase_a_current_A": "one of two columns, phase A",
        "phase_b_current_A": "one of two columns, phase B",
    },
    "t [s],cmd [deg],output angle [deg],encoder [deg],board temp [degC],coil temp [degC]": {
        "temperature_C": "'coil temp [degC]' may be it as well"
    },
}


@pytest.mark.parametrize("header", UNSURE)
def test_what_is_doubtful_says_why(header):
    mapping = guess_mapping(header.split(","))
    doubts = {entry.signal: why for entry in mapping.entries if (why := doubt(entry))}
    assert doubts.keys() == UNSURE[header].keys()
    assert all(why in doubts[signal] for signal, why in UNSURE[header].items())


def test_what_is_known_is_not_guessed_again():
    known = parse_mapping(["motor_position_rad=pos[deg]"])
    mapping = guess_mapping(["t [s]", "pos", "position [deg]"], known=known)
    assert mapping.get("motor_position_rad") == known.entries[0]
    assert mapping.get("user_position_rad").column == "position [deg]"


@given(st.lists(st.text(max_size=60), max_size=8))
def test_no_name_is_too_strange(names):
    mapping = guess_mapping(names)
    assert {e.column for e in mapping.entries} | {name for name, _ in mapping.unmapped} == set(names)


columns = st.text(st.characters(exclude_categories=["C", "Z"], exclude_characters="[]=,"), min_size=1, max_size=20)
numbers = st.floats(-1e9, 1e9).filter(lambda value: value != 0.0)


@given(st.sampled_from(sorted(SIGNALS)), columns, st.sampled_from([1, -1]), numbers, numbers, st.randoms())
def test_text_round_trip(signal, column, sign, scale, offset, random):
    units = list(UNITS[SIGNALS[signal].unit].values())
    entry = MappedColumn(signal, column, random.choice(units).name, sign, scale, offset)
    assert parse_mapping([entry.text]).entries == (entry,)
    bare = MappedColumn(signal, column)
    (again,) = parse_mapping([bare.text]).entries
    assert again.column == column and again.converter.is_si


def test_brackets_in_a_columns_own_name():
    (given,) = parse_mapping(["motor_speed_rad_s=speed [rpm]"], ["speed [rpm]"]).entries
    assert (given.column, given.unit) == ("speed [rpm]", "rpm")
    (given,) = parse_mapping(["motor_speed_rad_s=speed[rpm]"], ["speed"]).entries
    assert (given.column, given.unit) == ("speed", "rpm")
    (given,) = parse_mapping(["motor_speed_rad_s=speed_rpm"]).entries
    assert (given.column, given.unit) == ("speed_rpm", "rpm")
    (given,) = parse_mapping(["motor_speed_rad_s=speed_rpm[rad/s, sign=-1]"]).entries
    assert (given.unit, given.sign) == ("rad/s", -1)


ONE_IN_SI = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "rad": {
        "deg": pi / 180,
        "°": pi / 180,
        "turn": 2 * pi,
        "mrad": 1e-3,
        "arcmin": pi / 10800,
        "counts/4096": pi / 2048,
    },
    "rad/s": {
        "rpm": pi / 30,
        "1/min": pi / 30,
        "U/min": pi / 30,
        "deg/s": pi / 180,
        "rev/s": 2 * pi,
        "rad s^-1": 1.0,
        "counts/1456/s": pi / 728,
        "cps/1456": pi / 728,
        "ticks/819.2/s": pi / 409.6,
    },
    "m": {"mm": 1e-3, "µm": 1e-6, "in": 0.0254},
    "m/s": {"mm/s": 1e-3, "m/min": 1 / 60},
    "A": {"mA": 1e-3, "A": 1.0},
    "N·m": {"mNm": 1e-3, "N·m": 1.0, "N m": 1.0, "Ncm": 1e-2, "kgf·cm": 0.0980665, "oz-in": 0.00706155},
    "N": {"kN": 1e3, "lbf": 4.4482216},
    "V": {"mV": 1e-3},
    "": {"%": 0.01},
}


@pytest.mark.parametrize("dimension", ONE_IN_SI)
def test_units(dimension):
    for text, size in ONE_IN_SI[dimension].items():
        unit = find_unit(text, dimension)
        assert unit is not None, text
        assert unit.to_si([1.0, -2.0]) == pytest.approx([size, -2.0 * size], rel=1e-6), text
        assert unit.dimension == dimension
    assert find_unit("furlong", dimension) is None


def test_temperatures_have_an_offset():
    for text, value in {"K": 300.0, "°F": 80.33, "°C": 26.85}.items():
        unit = find_unit(text, "°C")
        assert unit is not None and unit.to_si([value]) == pytest.approx([26.85], abs=1e-9)


REFUSED = {
    "speed": "is not understood",
    "=speed": "is not understood",
    "motor_speed_rad_s=": "is not understood",
    "speed=x": "no signal 'speed'",
    "current_A=x[furlong]": "the unit 'furlong' is not known; it takes A, mA",
    "current_A=x[rpm]": "'rpm' is a unit of another kind",
    "current_A=x[A, sign=2]": "the sign must be 1 or -1",
    "current_A=x[A, scale=much]": "scale must be a number, not 'much'",
    "current_A=x[A, scale=0]": "the scale not 0",
    "current_A=x[A, offset=nan]": "numbers up to 1e30",
    "current_A=x[A, mA]": "unit stands twice",
    "motor_position_rad=x[counts]": "write [counts/4096]",
    "segment=x[A]": "is a unit of another kind",
}


@pytest.mark.parametrize("text", REFUSED)
def test_texts_refused(text):
    with pytest.raises(InputError) as caught:
        parse_mapping([text])
    assert REFUSED[text] in str(caught.value) and str(caught.value).isprintable()


def test_one_column_a_signal():
    with pytest.raises(InputError, match="current_A is given two columns, 'x' and 'y'"):
        parse_mapping(["current_A=x", "current_A=y"])
    mapping = parse_mapping(["current_A=x"]).with_entry(MappedColumn("current_A", "y"))
    assert mapping.texts == ("current_A=y",)


def test_mapped_numbers():
    table = {"ms": [0.0, 1.0, 2.0], "rpm": [0.0, 30.0, 60.0], "duty": [0.1, 0.2, 0.3], "i": [1.0, 2.0, 3.0]}
    mapping = parse_mapping(["time_s=ms[ms]", "motor_speed_rad_s=rpm[rpm,sign=-1]", "current_A=i[mA,scale=2,offset=1]"])
    signals, notes = apply_mapping(table, mapping)
    assert list(signals) == ["time_s", "motor_speed_rad_s", "current_A", "duty"]
    np.testing.assert_allclose(signals["time_s"], [0.0, 0.001, 0.002])
    np.testing.assert_allclose(signals["motor_speed_rad_s"], [0.0, -pi, -2.0 * pi])
    np.testing.assert_allclose(signals["current_A"], [1.002, 1.004, 1.006])
    assert "motor_speed_rad_s is column 'rpm', converted from rpm, its sign turned" in notes
    with pytest.raises(InputError, match="no column 'z'"):
        apply_mapping(table, ColumnMapping((MappedColumn("duty", "z"),)))


def test_clock_of_a_computer_keeps_its_digits():
    steps = np.arange(1000) * 125_000  # ns, 125 µs each
    signals, notes = apply_mapping({"ns": 1.7e18 + steps}, parse_mapping(["time_s=ns[ns]"]))
    assert signals["time_s"][0] == 0.0 and np.diff(signals["time_s"]).min() > 0.0
    np.testing.assert_allclose(signals["time_s"], steps * 1e-9, atol=3e-7)  # what a float of 1.7e18 can hold
    assert "counts from the first sample" in notes[0]


def test_a_mapped_file(tmp_path):
    path = tmp_path / "rig.csv"
    rows = (f"{4 * k},{k % 7 * 10},{-k},x\n" for k in range(150))
    path.write_text("time_ms,pos [deg],current_mA,note\n" + "".join(rows))
    columns = ["time_ms", "pos [deg]", "current_mA", "note"]
    measurement = read_measurement(path, guess_mapping(columns))
    assert list(measurement) == ["time_s", "motor_position_rad", "current_A"]
    assert measurement.sample_period_s == pytest.approx(0.004)
    np.testing.assert_allclose(measurement["current_A"], -np.arange(150) / 1e3)
    with pytest.raises(
        InputError, match=r"rig\.csv: no column 'time' for time_s; correct the mapping \(present: time_ms"
    ):
        read_measurement(path, ["time_s=time"])
