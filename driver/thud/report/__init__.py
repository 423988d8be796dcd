"""The calibration report of a recording, and the control chart of many reports."""

from thud.report.write import write_report as write_report
