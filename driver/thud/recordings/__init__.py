"""Recordings of drops: from the files of a laboratory to levels, verdict and report."""
