"""From source and instruments to a session."""
