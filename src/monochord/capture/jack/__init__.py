"""Code that runs in the audio thread or shares memory with it: atomics, ring buffer, libjack, callbacks.

Nothing here takes a lock, allocates memory or enters the Python interpreter in the audio thread.
"""
