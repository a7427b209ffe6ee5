"""Touch by physics alone: the closed-form inverse of one segment, or of both."""
