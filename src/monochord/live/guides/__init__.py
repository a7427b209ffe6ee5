"""Recordings and guided steps that a page starts: tuning, calibration, and touches with labels."""
