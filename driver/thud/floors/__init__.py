"""Rooms below floors: measured levels, their standardization and rating."""
