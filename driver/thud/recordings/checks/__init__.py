"""Checks of several drops, and of the force plate."""
