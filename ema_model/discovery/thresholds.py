"""The numbers that decide what a discovery claims, each with its source; `search.py` compares with them."""

from __future__ import annotations

import math

# --- how probable a model must be -------------------------------------------------------------------------------------

# Probability beforehand that anything of the library is missing, shared by all Terms: one in two.
ANY_MISSING = 0.5

# Logarithm of the odds from which on a Term is named: 99 to 1.
NAMED = math.log(99.0)

# The same, by the best fits alone, within which two of them are not told apart: 10 to 1, Jeffreys's "strong"
# (Theory of Probability, 1961).
AS_WELL = math.log(10.0)

# Logarithm of the evidence, by algebra, from which on a refit may make it enough; and the share of the greatest one.
WORTH_A_REFIT, MIGHT = 2.0, 0.6

# So many rivals may stand beside an effect; more say that the recordings do not tell which it is (MODEL §6).
LARGEST_GROUP = 3

# Of the error that is told, that must fall with an effect: a verdict says no more than its ladder (MODEL §6).
LEAST_FALL = 0.01

# Values that what a model lacks counts as in each recording, however long that is: it is no noise that is drawn anew
# with each sample, and a wrong Term of the same motion takes a share of it, too (Miller and Dunson, J. Am. Stat. Assoc.
# 114, 2019).  Beside a rest far above the floor, what takes a seventh of the error in three recordings is then named.
SHAPES = 20.0

# --- what speaks against an effect that is probable -------------------------------------------------------------------

# Probability that an effect's parameters differ so much between parts of the recordings by chance, below which they
# disagree; and how much of their size they must differ by, since no model is exact.
DISAGREES, APART = 1e-3, 0.35

# Samples, that a delay may differ by between parts: how late a sampled loop is depends on how it is moved.
LATE_BY = 0.5

# rad, that a phase may differ by between parts: half the power of the wave would be missed.
PHASES_APART = 1.0

# Tolerances of the file, by which a parameter must differ before it counts as another one, or a recording as another
# actuator's; and how much wider than them is looked.
ANOTHER, WIDER = 3.0, 4.0

# --- a closed loop, its controller, and inverse dynamics beside it ----------------------------------------------------

# Of the floor, beyond which a model is far off: nearer to it, two causes may share the error.
FAR = 2.0

# Of a model's error, below which one with an effect must stay for the effect to be needed.
HALF = 0.5

# Of a gain, that a drive's must differ by from the file's; drives' own scaling and a torque constant that is known to a
# few percent stay below.
GAIN_APART = 0.1

# Samples of the recording, by which a drive must answer later than the file's controller: less is how it is logged.
LATE_SAMPLES = 1.5

# Times what the drive's own law leaves of the current, that the file's must leave before it counts as another one.
LAW_APART = 1.1

# Of the current's rms, up to which a law of the file's form tells it; beyond, the drive is of another form.
LAW_HOLDS = 0.2

# Of the closed loop's error in floors, that inverse dynamics must come down to, where it does not reach its own floor,
# before it is said to explain what the loop does not: the two floors count different things.
MUCH_BETTER = 1.0 / 3.0

# Of the closed loop's error, that may be left where an effect of the drive was added, for the loop's account to stand:
# what takes away nineteen parts of twenty is not given up for a model that has no drive.  Where its first step leaves
# more, a model without the controller may take over early.
LOOP_TOLD = 0.05

# Of the closed loop's χ², that what is missing in its drive is expected to tell.  A drive that lacks one thing shows it
# (0.75 to 0.99 in the three-phase model's), one that is built otherwise shows a little of several (0.4 to 0.6).
TOLD_WELL = 2.0 / 3.0

# Floors that inverse dynamics may leave before any effect, up to which it may contradict one; and how much of an effect
# it may leave then, that is said to be none of it.
HEARD, GONE = 2.0, 0.3

# --- held-out recordings that contradict the fitted ones --------------------------------------------------------------

# Times the fitted recordings' error, that a held-out one must be missed by before it counts as contradicting them; and
# of that, what a sign, a zero or a unit put right must come down to.
MISSED, PUT_RIGHT = 3.0, 0.4

# Of what an effect changes by its square, that must be gone from the error of a held-out recording whose encoder is put
# right: at another turn than the true one it would add as much.
SHARED = 0.5

# --- how candidates are shown -----------------------------------------------------------------------------------------

# Fall of χ² at the candidate's best size, from which on it stands among those that are worth a look.
WORTH_A_LOOK = 10.0
