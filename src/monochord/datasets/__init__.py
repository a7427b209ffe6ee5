"""From sessions to windows with labels."""
