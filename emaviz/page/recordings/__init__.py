"""The Recordings tab and its panels."""
