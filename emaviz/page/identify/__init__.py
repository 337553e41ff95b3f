"""The Identify tab and its panels."""
