"""YAMNet: a small convolutional network of Google's that was trained to name the sounds of AudioSet."""

from monochord.perception.encoders.yamnet.mel import YamnetMel
from monochord.perception.encoders.yamnet.network import activations, embedding, probabilities
from monochord.perception.encoders.yamnet.reading import Convolution, Yamnet, load_yamnet

__all__ = [
    "Convolution",
    "Yamnet",
    "YamnetMel",
    "activations",
    "embedding",
    "load_yamnet",
    "probabilities",
]
