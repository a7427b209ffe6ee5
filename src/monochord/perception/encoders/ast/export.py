"""The transformer as a file in ONNX form, for other programs and other machines."""

from pathlib import Path

from monochord.perception.encoders.ast.graph import graph_of
from monochord.perception.encoders.ast.reading import read_weights


def export(given: str, file: Path, *, frames: int = 100, int8: bool = False) -> None:
    """Write the network that weights hold as an ONNX file; see `graph_of` beside this.

    What it takes are the patches that `patches_of` makes of a log-mel spectrogram.
    The file says in its properties which weights it was made of.

    Parameters
    ----------
    given
        Weights as `read_weights` takes them.
    file
        To write; one that is there is replaced.
    frames
        Of a spectrogram.
    int8
        Whether to quantise.

    Raises
    ------
    InputError
        If the weights cannot be used, the length does not suit them, or the onnx library is not installed.
    """
    file.write_bytes(graph_of(read_weights(given), frames=frames, int8=int8))
