"""Impacts of source models, one and many, and what else a case asks for."""
