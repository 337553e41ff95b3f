"""The numbers that decide what is said of units, each with its source."""

from __future__ import annotations

# Probability, over all pairs of a unit and a parameter together, that equal units are said to differ: half of the 1 %
# that may be claimed falsely, since a scatter over all units is looked for as well.
FALSE = 0.005

# The same once units differ at all, that one more difference is said than there is.
FURTHER = 0.01

# Of −2 log likelihood, within which two parameters of a unit cannot be told apart: twenty to one (Kass and Raftery,
# Bayes factors, J. Am. Stat. Assoc. 90, 1995: "strong").
ALIKE = 6.0

# Of the same on recordings that were not fitted, by which they must speak against a difference before it is dropped:
# "very strong", and a share of what the fitted ones say for it, since the model's own error in another command counts
# with it and grows with the difference.  In 100 made fleets (seeds 76000 … 76315) none of the true differences stood
# below −2, which leaves room for models that miss more.
REFUSED, REFUSED_SHARE = 10.0, 0.05

# 1 σ of the size of a difference, of itself, that stays unknown however much data there are: the simplified model's
# derivative is not the actuator's.  Of 34 differences in made fleets (seeds 100 … 117) the 90 % intervals held 85 %
# without it, 91 % with it.
SLOPE = 0.04

# Fewest units that can be said to scatter: of less, each is named that differs.
SCATTER_UNITS = 4

# Share of the units up to which those that differ in a parameter are named, each with its difference: of more, the type
# has a scatter.
MINORITY = 1.0 / 3.0

# Of a tolerance that is left where a unit's recordings tell nothing of a parameter, and where they tell it.
UNTOLD, TOLD = 0.9, 0.5

# Times the floor, of what the models leave in a unit, from which on that is said.
MISFIT = 2.0
