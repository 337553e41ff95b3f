"""Results in words, for the terminal, the page, reports and recordings alike."""
