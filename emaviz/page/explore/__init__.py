"""The Explore tab and its panels."""
