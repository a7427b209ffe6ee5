"""Physics alone: from the lines of a window to contact, place and force, with nothing learned."""
