"""Every number that decides in the tracking of flights."""

FALSE_TREND = 0.01  # probability of a trend that is none, of a unit's whole life, all k and all looks together
ONSET_EVERY = 4  # flights between two onsets that are looked at
SLOPES = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # of k in a flight, spread of what a trend may be
GROWN_BY = 10  # flights before one, by which it is told how far its sensitivities have grown with k
NOISE_PRIOR = 3.0  # flights, by which the stated noise counts beside the one that is seen

JUMP_BACK = 6.0  # of the differences' spread: towards healthy, a part replaced
JUMP_ON = 12.0  # the same away from healthy, where wear itself is uneven
JUMP_LEAST = 0.02  # of k, and no less
JUMP_AFTER = 3  # flights that must follow it
JUMP_SURE = 6  # flights after which one towards healthy is looked for once more
JUMP_WINDOW = 12  # flights beside it, by which its size is judged

LEAST_FLIGHTS = 8  # usable ones, before which nothing is told
MISFIT_WINDOW, MISFIT_SHARE = 10, 0.5  # of the last flights that the model fits badly: trends are then not trusted
WORN_BEFORE = 0.05  # of k, 1 σ of what a unit or a new part has already when its first flight is seen

LONGEST = 100_000.0  # flights; what would remain longer has no end that could be told
AHEAD = (1, 2, 5, 10, 20, 50, 100, 200)  # flights within which the probability of crossing is told
SAMPLES = 2000  # of the remaining life
