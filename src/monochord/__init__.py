"""Monochord: acoustic tactile sensing with a driven string.

A steel string is kept ringing by two electromagnetic drivers and heard by two contact microphones.
A touch splits it, and its spectrum tells contact, position, normal force and slip.

Importing this package loads no kernel compiler, plotting or device library; each room loads what it
needs when it is used.
"""

from importlib.metadata import version

__version__ = version("monochord")

__all__ = ["__version__"]
