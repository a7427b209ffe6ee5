"""The two circuits of the budget variant, drawn by a script."""
