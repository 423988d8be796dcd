"""Impacts of source models, one and many, and the other results of a case."""
