"""What runs in, or meets, the audio thread: atomics, ring buffer, libjack and the compiled callbacks.

Nothing here takes a lock, allocates or enters the Python interpreter while the audio thread is inside.
"""
