"""The Audio Spectrogram Transformer, log-mel bands and pretrained weights: a package of Monochord."""
