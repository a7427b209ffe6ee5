"""What estimators make of takes whose truth is known."""
