"""YAMNet as a feature of Monochord: a plug-in in a separate package."""

from monochord_yamnet.feature import Yamnet

__all__ = ["Yamnet"]
