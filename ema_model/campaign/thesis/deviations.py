"""Where this evaluation is not the thesis's own, and why."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Deviation:
    """One of them."""

    what: str
    thesis: str  # as printed
    here: str
    why: str


DEVIATIONS = (
    Deviation(
        "Phases' coefficients (T 3.3–3.5)",
        "a product with ζ",
        "N·[−sin(θₑ − 2πi/3)]·[1 + ζ cos(θ − φ + 2πi/3)]",
        "as printed, a rotor without eccentricity has no torque",
    ),
    Deviation(
        "Torque gain (T 3.10 with T 3.14)",
        "√2·Σ kᵢIᵢ, kᵢ with K = 0.0376 N·m/A",
        "2K·Σ kᵢIᵢ, which is 0.0752 N·m/A of the equivalent current",
        "as printed it is low by √2 against the monitor model's own gain: the motor would be off by 1e-2 rad, not 1e-3",
    ),
    Deviation(
        "Saturation of the torque",
        "1689 N·m",
        "1.689 N·m",
        "a slip of the decimal point: 22.5 A × 0.0752 N·m/A = 1.692 N·m",
    ),
    Deviation(
        "Friction at rest",
        "V = 0 or |F| ≤ F_static",
        "V = 0 and |F| ≤ F_static",
        "with “or”, what moves slowly enough would be stuck",
    ),
    Deviation(
        "Shorted turns in the monitor model (T 3.15)",
        "N̄ of the three phases on the time constant alone",
        "torque and back-EMF through the exact reduction f(θ) of the three phases, circuit as it is",
        "of the readings tried, this one has the least bias: k3 = 0.254 and 0.745 for 0.25 and 0.75; the thesis has "
        "0.229 and 0.720, T 3.15 literally 0.11 and 0.70",
    ),
    Deviation(
        "Turns that are left of a shorted phase",
        "1e-6",
        "2 % at the least",
        "the three-phase model diverges when two phases are shorted further",
    ),
    Deviation(
        "Scouts of SSA",
        "15 % of 50, which would be 7.5",
        "30 %",
        "its 65 evaluations an iteration are 50 and 15",
    ),
    Deviation(
        "The stop at an RMSE of 1e-3 A",
        "a tolerance beside 150 iterations",
        "150 iterations alone",
        "chopping leaves 0.43 A between the models at the true k: no search, the thesis's included, can get there",
    ),
    Deviation(
        "Err (T 5.2)",
        "k7 as a number",
        "as printed, and beside it with k7 as an angle",
        "k7 = 0 and k7 = 1 are the same direction, and count as farthest apart",
    ),
    Deviation(
        "Captions of tables 5.21 and 5.22",
        "G = 0.25 and 0.75",
        "G = 0.75 and 1.25",
        "k8 = 0.25 and 0.75 are these factors, as in tables 5.9 and 5.33",
    ),
    Deviation(
        "Time",
        "seconds of Simulink on the author's computer",
        "seconds of compiled code, one core a search, its kernels compiled before",
        "times of two machines say nothing of each other; the performance coefficient takes ratios within one",
    ),
    Deviation(
        "Our robust identification",
        "–",
        "means over 0.5 ms, a circuit that is the phases' equivalent, least squares from many starts, the bias of the "
        "monitor model taken out",
        "the thesis's medians are alike for all its algorithms, so that what is left there is bias of its model and "
        "its fitness, which no search removes",
    ),
)
