"""Export formats for sessions, one module per format."""

from monochord.core.registry import Registry
from monochord.sessions.exports._contents import Stretch, form_of, tables, write_back
from monochord.sessions.exports.base import Export

EXPORTS: Registry[Export] = Registry("monochord.sessions.exports", Export)

__all__ = ["EXPORTS", "Stretch", "form_of", "tables", "write_back"]
