"""The numbers that decide what a comparison says, each with its source."""

from __future__ import annotations

# Of the residual's means over 25 ms to their floor, from which on the model has failed.  98 of 100 healthy three-phase
# plants must pass it (tests/comparison/test_study.py).
SLOW = 2.0

# Standard deviations of the floor above 1, up to which a model is adequate, of the error pooled over signals: 99 of 100
# true models lie within.  Of 1,200 healthy three-phase plants 7 lie beyond (the plan `floors`, three seeds), of 30
# healthy hobby servos none: they end at 0.96 … 1.04.
BEYOND = 2.33

# Times the floor, up to which a discovery does not look for what a better model may still take: another effect's rest,
# which is seen long before its cause is.  Healthy three-phase plants leave 0.70 … 0.76 of the floors in which a
# discovery decides, from which nothing is taken off that a fit takes up.
BAND = 1.25

# Parameters at their bounds, and floors that are left, from which on a cascade's controller is doubted; of the delay
# with which the position follows its command, and samples of the recording, that it must then be apart from the
# file's.  A plant that is wrong alone (an inertia of 1.4 times, a viscous friction of 20 times) leaves a stiff loop's
# within 1 %.
AT_BOUNDS, MISSED, LAG_APART, LAG_SAMPLES = 3, 10.0, 0.2, 0.5

# Of what is left of a signal beyond its floor in one recording, that a step at one moment must explain to be told (one
# in the middle is half a step and half an offset, which a parameter may take up); of
# what a parabola over time explains, how many times as much it must explain; and of its standard deviation, how many
# times it must be (some hundred moments are tried).  Studied in tests/comparison/test_events.py.
EVENT_SHARE, EVENT_BEYOND_DRIFT, EVENT_T = 0.4, 1.2, 6.0

# Of a step, that must come within so many blocks on either side of its moment, and of a current's or a torque's within
# the time that a loop takes to answer: what a residual that swings, or a motor that stalls, does in its own time is no
# event (XL330's did both: tests/real_data/test_discovery.py).
EVENT_AT_ONCE, EVENT_BLOCKS, EVENT_LOOP_S = 0.5, 3, 0.05
