"""What each fault is, as an engineer is told who finds it in the ranking: equation, cause, size, what it looks like."""

from __future__ import annotations

from dataclasses import dataclass

from ema_model.actuator import Actuator
from ema_model.actuator.readings import sentences
from ema_model.discovery.result import Candidate
from ema_model.faults import NAMES, cause_of, vector

_TYPICAL = (0.25, 0.75)  # k of a low and a high fault, as the thesis has them


@dataclass(frozen=True)
class FaultPage:
    """A fault of the actuator, k1 … k8, in words."""

    equation: str  # what it changes in the base model's
    explanation: str
    shows: str
    mistaken_for: str
    line: str  # of the base model's equations, which it changes: a key of `model_equation`


def _short(phase: str) -> FaultPage:
    k = f"k_{'ABC'.index(phase) + 3}"
    return FaultPage(
        f"N_{phase} → (1 − {k}) N_{phase}",
        f"The insulation between turns of phase {phase} has failed, mostly from heat or vibration, so that a part of "
        "its winding carries no current. The phase gives less torque and less back-EMF, in its own stretches of each "
        "electric turn.",
        "in the current, as a ripple of twice the electric frequency, and as less torque per ampere",
        "torque ripple, demagnetisation, a short circuit of another phase",
        "current",
    )


PAGES = {
    "k1": FaultPage(
        "T_f → (1 + 2 k_1) T_f",
        "Lubricant has aged or is gone, a bearing or the screw is damaged: dry friction at rest and in motion grows, "
        "all of it by the same factor.",
        "in the current, with the sign of the speed",
        "demagnetisation, load-dependent friction, Stribeck friction, a tolerance of the file's friction",
        "friction",
    ),
    "k2": FaultPage(
        "b → (1 + 99 k_2) b",
        "Teeth, nut or joints are worn: the motor turns through the play b before the user's side follows, at each "
        "reversal.",
        "in the user's position after each reversal, and as knocks in the current",
        "position sensor delay, dead band, torsional compliance",
        "output",
    ),
    "k3": _short("A"),
    "k4": _short("B"),
    "k5": _short("C"),
    "k6": FaultPage(
        "B → (1 + k_6 cos(θ − φ)) B",
        "The rotor does not turn in the middle of the stator: bearings are worn, or the shaft is bent. The field B is "
        "stronger where the air gap is thin, at the angle φ = 2π(k7 − ½), and weaker on the other side; each phase "
        "meets it a third of a turn after the one before.",
        "in the current, once per turn beside the poles' own periods",
        "torque ripple, cogging torque, encoder eccentricity",
        "motion",
    ),
    "k8": FaultPage(
        "G → (0.5 + k_8) G",
        "The position loop's proportional gain is not the file's: it was set otherwise, or its electronics have "
        "drifted. No part of the mechanics is worn.",
        "in the user's position, which follows the command too fast or too slowly",
        "position sensor delay, speed loop integral action, another controller",
        "drive",
    ),
}


def page_of(name: str) -> FaultPage:
    """Of a fault, or of the one that it belongs to."""
    return PAGES[cause_of(name)[0]]


def size(one: Candidate, actuator: Actuator) -> str:
    """A fault's suggested size, physical and in k: 'backlash 703 µrad, k2 ≈ 0.20'."""
    phrases = dict(zip(NAMES, sentences(vector(one.settings), actuator)))
    return ", ".join([*(phrases[name] for name in one.settings), f"{one.name} ≈ {one.settings[one.name]:.2f}"])


def typical(name: str, actuator: Actuator) -> str:
    """'friction × 1.50 to 2.50 (k1 0.25 to 0.75)'."""
    first = cause_of(name)[0]
    low, high = (sentences(vector({first: k}), actuator)[NAMES.index(first)].split(" ") for k in _TYPICAL)
    apart = next(i for i, (one, other) in enumerate(zip(low, high)) if one != other)
    return f"{' '.join(low)} to {' '.join(high[apart:])} ({first} {_TYPICAL[0]:g} to {_TYPICAL[1]:g})"
