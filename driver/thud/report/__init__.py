"""The calibration report of a recording, and the control chart of many reports."""
