"""Libraries of the extra `sweep`: imported where they are needed, asked for by name where they are not there."""

from importlib import import_module
from typing import Any

__all__ = ["required"]


def required(module: str, what: str, *, without: str = "") -> Any:
    """The module. Raises ValueError, saying `what` needs it and how to install it, where it is not there.

    `without`: what does the same without the module, in words.
    """
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        other = f"; {without}" if without else ""
        raise ValueError(f"{what} needs {package}: pip install 'hedgebed[sweep]'{other}") from None
