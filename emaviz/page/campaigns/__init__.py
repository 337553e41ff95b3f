"""Campaigns: their progress and tables, and a row as a run."""
