"""The session's part of Discover."""
