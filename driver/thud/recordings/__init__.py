"""Recordings of a force plate: reading, drops, levels and the verdict."""
