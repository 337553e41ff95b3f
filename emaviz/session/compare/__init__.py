"""The session's part of Compare."""
