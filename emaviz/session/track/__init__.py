"""The session's part of Track: a folder of flights, followed on the compute thread."""
