"""The frozen Audio Spectrogram Transformer, with the network of Hugging Face's transformers.

Source: Y. Gong, Y.-A. Chung and J. Glass, AST: Audio Spectrogram Transformer, Interspeech 2021.
"""
