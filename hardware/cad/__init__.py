"""CAD of the sensor: parts whose dimensions come from a sensor preset. Lengths are in mm, as in STEP."""
