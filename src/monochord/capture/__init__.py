"""Audio capture: sources, other instruments, JACK, DDS, and the recording loop."""
