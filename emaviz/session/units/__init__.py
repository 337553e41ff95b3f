"""The session's part of Units: a folder of units' folders, compared on the compute thread."""
