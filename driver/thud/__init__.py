"""thud: the force that heavy/soft impact sources put into floors.

>>> import thud
>>> impact = thud.solve(thud.Ball(), thud.Drop(height=1.0))
>>> round(1000 * impact.contact_time, 2)
20.43
"""

from lazy_loader import attach_stub

from thud.base.bridge import version
from thud.base.checks import suggestion
from thud.base.errors import InputError
from thud.base.extras import require_extra

__version__ = version()
_attribute, _, __all__ = attach_stub(__name__, __file__)


class _MissingError(InputError, AttributeError):
    """A name whose packages are not installed: `hasattr` and `help` do without it."""


def __dir__() -> list[str]:
    """Return the public names."""
    return [*__all__, "__version__"]


def __getattr__(name: str) -> object:
    """Import a name of the stub at its first use."""
    if name not in __all__:
        message = f"module 'thud' has no attribute {name!r}{suggestion(name, __all__)}"
        raise AttributeError(message)
    try:
        with require_extra("studies"):
            return _attribute(name)
    except InputError as error:
        raise _MissingError(str(error)) from error
