"""What a column's name says: its quantity, whose it is, its unit; German words put into the English ones."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from ema_model.files.opened import shown
from ema_model.quantities.axes import SIGNALS
from ema_model.quantities.titles import in_sentence
from ema_model.quantities.unit_conversion import UNITS, find_unit

# What is measured.
QUANTITIES: dict[str, frozenset[str]] = {
    name: frozenset(words.split())
    for name, words in {
        "time": "t time times timestamp timestamps timestep clock elapsed stamp date datetime",
        "position": "pos position positions angle theta q phi encoder enc rotation displacement stroke x joint "
        "resolver",
        "speed": "speed velocity vel omega w rpm dq qd qdot dtheta thetadot dx xdot angularvelocity",
        "current": "current curr cur iq ieq amps amperage i im imot",
        "torque": "torque trq tau moment",
        "force": "force thrust",
        "voltage": "voltage volt volts v u vbus vdc vin vm vmot vq ubus udc vsupply vbat",
        "duty": "duty dutycycle pwm",
        "temperature": "temp temperature temps",
        "enabled": "enable enabled",
        "segment": "segment seg run trial episode repetition rep lap",
    }.items()
}
# Whose it is.
COMMAND = frozenset(
    "cmd command commanded setpoint sp set target goal ref reference desired des demand wanted action".split()
)
MEASURED = frozenset(
    "act actual meas measured fb feedback present raw value val estimate estimated est filtered".split()
)
MOTOR = frozenset("motor mot rotor drive m mech".split())
USER = frozenset("user u output out load joint link arm surface flap rudder aileron elevator actuator rod ram".split())
LOAD = frozenset("load ext external disturbance hinge aero".split())
BUS = frozenset("bus vbus vdc vin ubus udc vsupply vbat dc dclink supply battery bat input".split())
# What spoils a match: another axis of the same quantity.
OTHER = {
    "current": frozenset("id bus dc battery bat supply input limit max min".split()),
    "speed": frozenset("limit max min".split()),
    "voltage": frozenset("vd limit max min".split()),
    "torque": frozenset("limit max min enable enabled friction".split()),
    "position": frozenset("limit max min error err".split()),
    "temperature": frozenset("limit max".split()),
}
_MERGED = (
    (("time", "stamp"), "timestamp"),
    (("set", "point"), "setpoint"),
    (("duty", "cycle"), "dutycycle"),
    (("angular", "velocity"), "angularvelocity"),
    (("angular", "speed"), "angularvelocity"),
    (("angular", "position"), "angle"),
    (("i", "q"), "iq"),
    (("i", "d"), "id"),
    (("v", "bus"), "vbus"),
    (("v", "dc"), "vdc"),
    (("v", "in"), "vin"),
    (("u", "dc"), "udc"),
    (("v", "q"), "vq"),
    (("v", "d"), "vd"),
    (("q", "dot"), "qdot"),
    (("theta", "dot"), "thetadot"),
    (("d", "theta"), "dtheta"),
    (("d", "q"), "dq"),
)
_GREEK = str.maketrans({"θ": " theta ", "ω": " omega ", "φ": " phi ", "ϕ": " phi ", "τ": " tau ", "Δ": " d "})
# Single letters are words as often as units; they count as a unit where the quantity fits.
_MOST_WORDS_OF_A_UNIT = 3


@dataclass(frozen=True)
class Name:
    """A column's name, taken apart: small words, the unit's text or "", and whether brackets set the unit off."""

    words: tuple[str, ...]
    unit: str
    bracketed: bool = False

    def has(self, words: frozenset[str]) -> bool:
        """Whether any of these is among its words."""
        return not words.isdisjoint(self.words)


def readings(column: str) -> list[Name]:
    """The ways to read a name: with its last words as a unit, where they are one, longest first, then without."""
    bracketed = re.fullmatch(r"(.*?)[\s_,;:]*[\[({]([^\[\](){}]*)[\])}]\s*", column, re.S)
    if bracketed and _is_unit(bracketed[2]):
        return [Name(_words(bracketed[1]), bracketed[2].strip(), True)]
    spoken = re.fullmatch(r"(.*\S)\s+in\s+(\S+)\s*", column, re.S)
    if spoken and _is_unit(spoken[2]):
        return [Name(_words(spoken[1]), spoken[2], True)]
    parts = [part for part in re.split(r"[\s_.,;:()\[\]{}|-]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", column)) if part]
    found = []
    counted = len(parts) - 1 if len(parts) > 2 and parts[-1].isdecimal() else 0  # one of several: q_rad_7
    for length in range(min(_MOST_WORDS_OF_A_UNIT, counted - 1), 0, -1):
        unit = "_".join(parts[counted - length : counted])
        if _is_unit(unit):
            found.append(Name(_words("_".join(parts[: counted - length])), unit))
    for length in range(min(_MOST_WORDS_OF_A_UNIT, len(parts) - 1), 0, -1):
        unit = "_".join(parts[-length:])
        if _is_unit(unit) and not unit.isdecimal():  # which counts columns
            found.append(Name(_words("_".join(parts[:-length])), unit))
    return [*found, Name(_words(column), "")]


def is_time(name: str) -> bool:
    """Whether a column's name says that it is time."""
    return any(not QUANTITIES["time"].isdisjoint(one.words) for one in readings(name))


def _is_unit(text: str) -> bool:
    return len(text) <= 24 and any(find_unit(text, dimension) for dimension in UNITS)


def _words(text: str) -> tuple[str, ...]:
    text = text[:200].translate(_GREEK).replace("Ω", " ")
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", text)
    spelt = (word.rstrip("0123456789") or word for word in re.split(r"[^a-z0-9]+", without_umlauts(text)) if word)
    merged: list[str] = []
    for word in itertools.chain.from_iterable(map(in_english, spelt)):
        merged.append(word)
        for pair, whole in _MERGED:
            if tuple(merged[-2:]) == pair:
                merged[-2:] = [whole]
                break
    return tuple(merged)


# --- german names of columns, put into the English words that guessing knows: Motordrehzahl is motor, speed -----------

_ENGLISH = {
    # what is measured
    "zeitstempel": "timestamp",
    "uhrzeit": "time",
    "zeit": "time",
    "datum": "date",
    "drehwinkel": "angle",
    "winkel": "angle",
    "lage": "position",
    "weg": "displacement",
    "hub": "stroke",
    "drehzahl": "speed",
    "winkelgeschwindigkeit": "angularvelocity",
    "geschwindigkeit": "speed",
    "strom": "current",
    "drehmoment": "torque",
    "moment": "torque",
    "kraft": "force",
    "spannung": "voltage",
    "temperatur": "temperature",
    "tastgrad": "duty",
    "freigabe": "enable",
    "abschnitt": "segment",
    "versuch": "trial",
    "position": "position",
    # whose, and whether it is wanted or measured
    "soll": "setpoint",
    "fuehrungs": "setpoint",
    "ist": "actual",
    "mess": "measured",
    "motor": "motor",
    "rotor": "rotor",
    "abtriebs": "output",
    "ausgangs": "output",
    "klappen": "flap",
    "last": "load",
    "stoer": "disturbance",
    "zwischenkreis": "bus",
    "versorgungs": "supply",
    "batterie": "battery",
    "wert": "value",
}
_PARTS = re.compile("|".join(sorted(_ENGLISH, key=len, reverse=True)))
_NOUNS = frozenset(_ENGLISH) - {"position", "motor", "rotor"}  # which English has too
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss"})


def without_umlauts(text: str) -> str:
    """Small letters with ä, ö, ü and ß spelt out."""
    return text.lower().translate(_UMLAUTS)


def in_english(word: str) -> list[str]:
    """The English words of one that is made up of German ones only; any other word as it is."""
    parts = _PARTS.findall(word)
    if "".join(parts) != word or _NOUNS.isdisjoint(parts):
        return [word]
    return [_ENGLISH[part] for part in parts]


# --- which signals a column may be by its name alone, and in which unit -----------------------------------------------

_CURRENT_WORDS = frozenset("i im iph phase ph cur curr current".split())
_ROTARY = frozenset("angle theta q phi rotation encoder enc resolver".split())
_PHASE_OF = dict(zip("abcuvw", "abcabc"))


@dataclass(frozen=True)
class Guess:
    """A signal that a column may be."""

    signal: str
    unit: str
    confidence: float
    reason: str


class Context:
    """What the other columns tell about one."""

    def __init__(self, names: list[str], known: Iterable[str]) -> None:
        """names: of the file's columns; known: signals that others of them are already."""
        every = [readings(name)[0] for name in names]
        self.lowered = {name.lower() for name in names}
        self.has_position_command = any(signal.startswith("command") for signal in known) or any(
            _is_commanded(name, what) for name in every if (what := _quantity(name)) in ("position", "")
        )
        positions = {signal.rpartition("_")[0] for signal in known if "_position_" in signal}
        self.is_at_user = positions == {"user_position"}  # the only place where motion was recorded
        self.has_duty = any(_quantity(name) == "duty" for name in every)

    def phase_letter(self, name: str) -> tuple[str, str, int] | None:
        """The letter that tells two or three columns apart, the name without it, and how many there are: i_a, i_b."""
        lowered = name.lower()
        for least in (3, 2):
            for match in re.finditer(r"[a-cu-w]", lowered):
                at = match.start()
                for letters in ("abc", "uvw"):
                    alike = {lowered[:at] + x + lowered[at + 1 :] for x in letters} & self.lowered
                    if match[0] in letters and len(alike) >= least:
                        return match[0], name[:at] + name[at + 1 :], len(alike)
        return None


def _quantity(name: Name) -> str:
    """What is measured, or "".  `current` before another quantity means present: `current_position`."""
    found = [(at, what) for at, word in enumerate(name.words) for what, words in QUANTITIES.items() if word in words]
    if not found:
        return ""
    whats = [what for _, what in found]
    if whats == ["time"] and "t" in name.words:
        if name.has(LOAD | MOTOR) or find_unit(name.unit, "N·m"):
            return "torque"  # T_load, T_m
        if find_unit(name.unit, "°C"):
            return "temperature"
    if whats[-1] == "voltage" and name.words[found[-1][0]] in ("v", "u"):
        if "position" in whats:
            return "position"  # theta_u
        if find_unit(name.unit, "m/s") or find_unit(name.unit, "rad/s"):
            return "speed"
    if "enabled" in whats:
        return "enabled"
    for what in ("speed", "temperature", "duty"):
        if what in whats and not (what == "speed" and "time" in whats):
            return what
    if whats[0] == "current" and name.words[found[0][0]] == "current" and len(set(whats)) > 1:
        return next(what for what in whats if what != "current")
    # The last is the noun: `motor angle time` is a time; `joint torque` a torque.
    return whats[-1]


def _is_commanded(name: Name, quantity: str) -> bool:
    return name.has(COMMAND) or (quantity == "position" and "input" in name.words)


def guesses(column: str, context: Context, counts_per_turn: int | None) -> list[Guess] | str:
    """The signals that a column may be, or why it is none."""
    if column in SIGNALS:
        return [Guess(column, "", 1.0, "the name is the signal's own")]
    told = context.phase_letter(column)
    phase = _phase(*told) if told else None
    if phase:
        return [phase]
    problem = ""
    for name in readings(column):
        quantity = _quantity(name)
        found = _by_quantity(name, quantity, context)
        if isinstance(found, str):
            problem = problem or found
            continue
        fitting = [guess for guess in found if not name.unit or find_unit(name.unit, SIGNALS[guess.signal].unit)]
        if fitting:
            return [g for guess in fitting if (g := _by_name_with_unit(guess, name, counts_per_turn))] or (
                "it is in counts; the counts per turn are needed"
            )
    return problem or "its name says nothing known"


def _by_name_with_unit(guess: Guess, name: Name, counts_per_turn: int | None) -> Guess | None:
    dimension = SIGNALS[guess.signal].unit
    if not name.unit:
        unit = "counts" if not {"counts", "ticks", "count"}.isdisjoint(name.words) and dimension == "rad" else ""
        if not unit:
            return replace(guess, confidence=guess.confidence - (0.1 if dimension else 0.0))
    else:
        found = find_unit(name.unit, dimension)
        unit = found.name if found else ""
    if unit in ("counts", "counts/s"):
        if not counts_per_turn:
            return None
        unit = unit.replace("counts", f"counts/{counts_per_turn}")
    return replace(guess, unit=unit, reason=f"{guess.reason}; unit {unit}" if unit else guess.reason)


def _phase(letter: str, rest: str, count: int) -> Guess | None:
    """One of so many columns, whose name without the phase's letter is `rest`; two may as well be two motors'."""
    for name in readings(rest):
        unit = find_unit(name.unit, "A") if name.unit else None
        if name.has(COMMAND) or (name.unit and not unit):
            continue
        if unit or (name.has(_CURRENT_WORDS) and not name.has(QUANTITIES["voltage"])):
            signal = f"phase_{_PHASE_OF[letter]}_current_A"
            of = {2: "two", 3: "three"}[count]
            sure = 0.9 if count == 3 else 0.55
            return Guess(signal, unit.name if unit else "", sure, f"one of {of} columns, phase {letter.upper()}")
    return None


def _by_quantity(name: Name, quantity: str, context: Context) -> list[Guess] | str:
    """Candidates from what is measured, whose it is, and whether it is wanted or measured."""
    said = " ".join(name.words)
    if quantity in OTHER and name.has(OTHER[quantity]) and not (quantity == "voltage" and name.has(BUS)):
        other = next(word for word in name.words if word in OTHER[quantity])
        return f"{other!r} makes it another quantity"
    commanded = _is_commanded(name, quantity)
    if commanded and quantity not in ("position", "", "time"):
        return f"a commanded {quantity}; only a position's command is used"
    if commanded and quantity != "time":
        sure = 0.9 if quantity else 0.65
        linear = "command_m" if _is_linear(name) else "command_rad"
        return [Guess(linear, "", sure, f"{said!r} is a position that is commanded")]
    if quantity == "position":
        return _positions(name, said, context)
    return _others(name, quantity, said, context)


def _positions(name: Name, said: str, context: Context) -> list[Guess] | str:
    kind = "m" if _is_linear(name) else "rad"
    motor, user = f"motor_position_{kind}", f"user_position_{kind}"
    if name.has(MOTOR):
        return [Guess(motor, "", 0.9, f"{said!r} is the motor's position")]
    if name.has(USER):
        return [Guess(user, "", 0.85, f"{said!r} is the position of the output")]
    if context.has_position_command and not name.has(frozenset({"encoder", "enc", "resolver"})):
        reason = f"{said!r} is a position, and the file has a command for it to follow"
        return [Guess(user, "", 0.7, reason), Guess(motor, "", 0.5, f"{said!r} is a position")]
    reason = f"{said!r} is a position, with no command for it to follow"
    return [Guess(motor, "", 0.65, reason), Guess(user, "", 0.5, f"{said!r} is a position")]


def _is_linear(name: Name) -> bool:
    if not name.unit:
        return not {"x", "stroke", "displacement"}.isdisjoint(name.words)
    return find_unit(name.unit, "m") is not None and not name.has(_ROTARY)


def _others(name: Name, quantity: str, said: str, context: Context) -> list[Guess] | str:
    plain = bool(set(name.words) <= QUANTITIES.get(quantity, frozenset()) | MOTOR | MEASURED)
    sure = 0.85 if plain else 0.65
    if quantity == "time":
        return [Guess("time_s", "", sure + 0.1, f"{said!r} is time")]
    if quantity == "speed":
        linear = find_unit(name.unit, "m/s") is not None or "dx" in name.words or "xdot" in name.words
        unit = "m_s" if linear else "rad_s"
        if (name.has(USER) or context.is_at_user) and not name.has(MOTOR):
            return [Guess(f"user_speed_{unit}", "", 0.85, f"{said!r} is the speed of the output")]
        return [Guess(f"motor_speed_{unit}", "", sure, f"{said!r} is a speed")]
    if quantity == "current":
        surer = 0.05 if name.has(frozenset({"iq", "ieq"})) else 0.0
        return [Guess("current_A", "", sure + surer, f"{said!r} is a current")]
    if quantity == "torque":
        signal = "load_torque_Nm" if name.has(LOAD) else "motor_torque_Nm"
        return [Guess(signal, "", 0.85 if name.has(LOAD | MOTOR) else 0.6, f"{said!r} is a torque")]
    if quantity == "voltage":
        signal = "bus_voltage_V" if name.has(BUS) or (context.has_duty and not name.has(MOTOR)) else "motor_voltage_V"
        known = name.has(BUS | MOTOR | {"vm", "vmot", "vq"})
        return [Guess(signal, "", 0.85 if known else 0.5, f"{said!r} is a voltage")]
    if quantity == "force":
        signal = "load_force_N" if name.has(LOAD) else "motor_force_N"
        return [Guess(signal, "", 0.85 if name.has(LOAD | MOTOR) else 0.6, f"{said!r} is a force")]
    table = {"duty": "duty", "temperature": "temperature_C", "segment": "segment"}
    table["enabled"] = "drive_enabled"
    if quantity in table:
        return [Guess(table[quantity], "", sure, f"{said!r} is {in_sentence(SIGNALS[table[quantity]].title)}")]
    if name.words[-1:] == ("load",):
        sure = 0.6 if name.unit else 0.35
        return [Guess(load, "", sure, f"{said!r} is a load") for load in ("load_torque_Nm", "load_force_N")]
    return _by_unit_alone(name)


def _by_unit_alone(name: Name) -> list[Guess] | str:
    for dimension, signal in {"rad/s": "motor_speed_rad_s", "A": "current_A", "°C": "temperature_C"}.items():
        if len(name.unit) > 1 and find_unit(name.unit, dimension):
            return [Guess(signal, "", 0.4, f"only its unit, {shown(name.unit)}, tells")]
    if not name.unit and len(name.words) == 1 and find_unit(name.words[0], "s") and len(name.words[0]) > 1:
        return [Guess("time_s", name.words[0], 0.6, f"{name.words[0]!r} is a unit of time")]
    return "its name says nothing known"
