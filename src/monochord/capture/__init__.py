"""What is captured: sources of audio, instruments beside it, JACK, DDS, and the recording loop."""
