"""The session's part of Identify: the race of searches, its answer, and the cost around it."""
