"""The app without a screen: what is open, what is asked for, and the work on the compute thread."""

import emaviz.formats  # noqa: F401  they join the family
