"""The page's tabs, one a file: each builds its controls and wires them to the session."""
