"""Errors of the library as Python exceptions."""


class ThudError(Exception):
    """Any error of thud; its text is one sentence for the user.

    Attributes
    ----------
    exit_code : int
        Exit code that the commands use for this error.
    """

    exit_code = 2


class FitWarning(UserWarning):
    """A fit has an answer that is not to be trusted in every respect."""


class InputError(ThudError, ValueError):
    """The input cannot be used; names group, key, value and allowed range."""

    exit_code = 1


class NumericalError(ThudError, ArithmeticError):
    """The computation could not be carried through."""

    exit_code = 2
