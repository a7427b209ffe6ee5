"""Touch by physics alone: from the lines of one segment, or of both; nothing is learned."""
