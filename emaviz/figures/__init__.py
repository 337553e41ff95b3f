"""The figures, one a file, used by the app and by reports alike."""
