"""Sessions in other forms: one file a form, found by its name."""

from monochord.exports._contents import form_of
from monochord.exports.base import Export
from monochord.registry import Registry

EXPORTS: Registry[Export] = Registry("monochord.exports", Export)

__all__ = ["EXPORTS", "form_of"]
