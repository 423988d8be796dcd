"""Levels of forces, the criteria of the standards, and ratings."""
