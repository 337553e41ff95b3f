"""The side file NAME.toml beside a recording, read and written."""
