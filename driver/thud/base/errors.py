"""Errors of the library as Python exceptions."""


class ThudError(Exception):
    """Base of the errors of thud; the message is one sentence for the user.

    Attributes
    ----------
    exit_code : int
        Exit code that the commands use for this error.
    """

    exit_code = 2


class FitWarning(UserWarning):
    """A result of a fit is unreliable in some respect."""


class PlausibilityWarning(UserWarning):
    """A result is possible but implausible."""


class ReportWarning(UserWarning):
    """A report lacks a figure, a file or characters, or replaces another report."""


class InputError(ThudError, ValueError):
    """The input is invalid; the message names group, key, value and allowed range."""

    exit_code = 1


class NumericalError(ThudError, ArithmeticError):
    """The computation failed."""

    exit_code = 2
