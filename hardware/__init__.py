"""Open hardware of Monochord. No person has built a sensor from these files yet."""
