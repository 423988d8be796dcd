"""Impacts, recordings and spectra compared on one page."""
