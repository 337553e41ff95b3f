"""The numbers that decide what a discovery claims, each with its source."""

from __future__ import annotations

# ΔBIC from which on data decide between two models: Kass and Raftery, Bayes factors, J. Am. Stat. Assoc. 90 (1995).
LEAST_BIC = 10.0

# Of evidence, from which on what was fitted stands alone where nothing else could tell: ten times as much.
BEYOND_DOUBT = 100.0

# Of evidence, within which rivals cannot be told apart: the same.
TIE = 10.0

# Of the fall of χ² of the best effect, from which on another cannot be told from it where much more than the noise is
# left (FAR): that rest, whose cause nobody knows, falls a little with the one or the other by chance.
ALIKE = 0.95

# Of the fall of χ² of an effect, that another must have told to be weighed against it again once more is in the model:
# of two that are alike, what both leave may fall a little more with the wrong one (the study's pair 9000: 0.998).
NEAR_AS_MUCH = 0.9

# Cosine between what two laws of friction, by place and by speed, change, from which on the motion does not tell them
# apart (a robot's joint that goes back and forth: 0.88, and what was held out prefers the one that tells less).
ONE_MOTION = 0.85

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

# Samples, that a delay may differ by between parts: how late a sampled loop is depends on how it is moved.
LATE_BY = 0.5

# rad, that a phase may differ by between parts: half the power of the wave would be missed.
PHASES_APART = 1.0

# Of χ² beyond the floor, that an effect must explain where it does not bring the error near the floor: what
# tells less of an error whose cause is not known may be a part of that cause (a drive's bias is a constant load).
LEAST_SHARE = 0.25

# Of what a model leaves beyond the floor, though it may be true as it is: an effect must take more (right ones of the
# own study take 0.8 or more; false ones of servos took 0.2 to 0.5).
OF_FAINT = 0.5

# Half-widths of its 90 % interval, that an effect's strength must be from none, which is 2.5 σ: right ones of the rigs
# are 1.6 or more from it, and all but eight of 230 three or more; a false one was 1.1.
NONE_OF_IT = 1.5

# Of the floor, beyond which that share is asked for: nearer to it, two causes may share the error (a shorted phase and
# cogging), and the own studies name no effect falsely.
FAR = 2.0

# Of the error, that an effect must take away beside a model whose parameters keep to their tolerances (MODEL §6).
LEAST_FALL = 0.01

# σ of its tolerance, by which an effect must move a parameter to drive it to its bound: one that stands a hair off the
# bound without the effect as well (a scale that no recording tells) is no sign of anything.
DRIVEN = 0.5

# Of what the residual's own curve tells, that an effect must tell: a curve has more freedom.
AS_MUCH = 0.9

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

# Of a model's error, below which one with an effect must stay for the effect to be needed.
HALF = 0.5

# Of the closed loop's χ², that what is missing in its drive is expected to tell.  A drive that lacks one thing shows it
# (0.75 to 0.99 in the three-phase model's), one that is built otherwise shows a little of several (0.4 to 0.6).
TOLD_WELL = 2.0 / 3.0

# Floors that inverse dynamics may leave before any effect, up to which it may contradict one; and how much of an effect
# it may leave then, that is said to be none of it.
HEARD, GONE = 2.0, 0.3

# Times the fitted recordings' error, that a held-out one must be missed by before it counts as contradicting them; and
# of that, what a sign, a zero or a unit put right must come down to.
MISSED, PUT_RIGHT = 3.0, 0.4

# Of what an effect changes by its square, that must be gone from the error of a held-out recording whose encoder is put
# right: at another turn than the true one it would add as much.
SHARED = 0.5

# Tolerances of the file, by which a parameter must differ before a recording counts as another actuator's; and how much
# wider than them is looked.
ANOTHER, WIDER = 3.0, 4.0

# Fall of χ² at the candidate's best size, from which on a card calls its evidence strong, and moderate.
EVIDENCE = (200.0, 50.0)
