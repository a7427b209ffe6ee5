"""Touch by the closed-form inverse of one segment, or of both.

For one segment nothing is learned. For both it is physics, with modes chosen by networks trained on simulated
builds.
"""
