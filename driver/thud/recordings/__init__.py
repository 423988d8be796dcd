"""Recordings of drops: files of force plates and loggers, read piecewise in newtons."""
