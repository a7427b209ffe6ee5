"""A skin: several strings on one link of a robot, whose touches are points and wrenches in the link's frame.

`load_skin` reads where the strings lie; `Skin.listen` runs them all at once, and `Skin.combine` makes one
`SkinUpdate` of the strings' estimates at an instant. `monochord.skin.urdf` writes the strings for ROS.
"""

from monochord.skin.geometry import Neighbours, SkinString
from monochord.skin.skin import Skin, load_skin
from monochord.skin.update import SkinContact, SkinUpdate

__all__ = ["Neighbours", "Skin", "SkinContact", "SkinString", "SkinUpdate", "load_skin"]
