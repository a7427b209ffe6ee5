"""The Audio Spectrogram Transformer, frozen: its weights read, its embedding of a short log-mel spectrogram.

Source: Y. Gong, Y.-A. Chung and J. Glass, AST: Audio Spectrogram Transformer, Interspeech 2021.
"""
