"""YAMNet as a feature of Monochord: a plug-in in a package of its own."""

from monochord_yamnet.feature import Yamnet

__all__ = ["Yamnet"]
