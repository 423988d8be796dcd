"""Rooms below floors: measured levels, their standardisation and rating."""
