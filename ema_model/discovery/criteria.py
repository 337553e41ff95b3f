"""The numbers that decide what a discovery claims, each with its source."""

from __future__ import annotations

# ΔBIC from which on data decide between two models: Kass and Raftery, Bayes factors, J. Am. Stat. Assoc. 90 (1995).
LEAST_BIC = 10.0

# Of evidence, within which rivals cannot be told apart: the same.
TIE = 10.0

# So many rivals may stand beside an effect; more say that the recordings do not tell which it is (MODEL §6).
LARGEST_GROUP = 3

# Of the fall of χ² of an effect that is refused, that the next one must reach: else it only bends as that one does.
SECOND = 0.5

# Of evidence of one moment, from which on it is beyond chance, and in how many apart it must be seen: a bus sags only
# where the drive is at its limit (MODEL §6, a showable effect has 25).
MOMENT, MOMENTS = 25.0, 2

# Probability that an effect's parameters differ so much between parts of the recordings by chance, below which they
# disagree; and how much of their size they must differ by, since no model is exact.
DISAGREES, APART = 1e-3, 0.35

# rad, that a phase may differ by between parts: half the power of the wave would be missed.
PHASES_APART = 1.0

# Of χ² beyond the floor, that an effect must explain where it does not bring the error near the floor: what
# tells less of an error whose cause is not known may be a part of that cause (a drive's bias is a constant load).
LEAST_SHARE = 0.25

# Of the floor, beyond which that share is asked for: nearer to it, two causes may share the error (a shorted phase and
# cogging), and the own studies name no effect falsely.
FAR = 2.0

# Of the error, that an effect must take away beside a model whose parameters keep to their tolerances (MODEL §6).
LEAST_FALL = 0.01

# Of what the residual's own curve tells, that an effect must tell: a curve has more freedom.
AS_MUCH = 0.9

# What an effect's parameters are where it is physics: beyond, something else is bent into its place.  A sensor or a
# magnet that is off by a third is found by hand; a spring pulls back.
PLAUSIBLE = {
    ("current_sensor_gain", "ratio"): (-0.3, 0.3),
    ("demagnetisation", "ratio"): (0.0, 0.4),
    ("hinge_moment", "stiffness_Nm_rad"): (0.0, float("inf")),
    ("asymmetric_friction", "ratio"): (-0.6, 0.6),
    ("load_dependent_friction", "ratio"): (0.0, 0.6),
    ("gear_load_friction", "ratio"): (0.0, 0.8),
    ("torque_ripple", "ratio"): (0.0, 0.5),
}
