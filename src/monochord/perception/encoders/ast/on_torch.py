"""The transformer in PyTorch, on the processor or on a GPU."""

from typing import TYPE_CHECKING, Any

from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.patches import patches_of
from monochord.perception.encoders.ast.tensors import HEAD, AstWeights, cropped

if TYPE_CHECKING:
    from torch import Tensor

EPSILON = 1e-12
"""Added to a variance before its root is taken, as the published network has it."""


class OnTorch:
    """Embed log-mel spectrograms of one length.

    Parameters
    ----------
    weights
        As read; their positions are cropped to fit.
    frames
        Of a spectrogram.
    device
        As PyTorch names it: ``cpu``, ``cuda``.

    Raises
    ------
    InputError
        If PyTorch is not installed, or the spectrogram's length does not suit the weights.
    DeviceError
        If there is no such device.

    Examples
    --------
    >>> import numpy as np
    >>> from monochord.perception.encoders.ast.tensors import random_weights
    >>> embed = OnTorch(random_weights(seed=0, depth=1, width=64), frames=100)
    >>> embed(np.zeros((2, 100, 128), np.float32)).shape
    (2, 128)
    """

    def __init__(self, weights: AstWeights, *, frames: int, device: str = "cpu") -> None:
        torch = _torch()
        fitting = cropped(weights, frames)
        self._torch, self._depth, self._heads = torch, fitting.depth, fitting.width // HEAD
        try:
            self._device = torch.device(device)
            self._tensors = {
                name: torch.from_numpy(tensor).to(self._device) for name, tensor in fitting.tensors.items()
            }
        except (RuntimeError, AssertionError) as error:
            reason = str(error).partition("\n")[0]
            raise DeviceError(
                f"no device '{device}' for the encoder ({reason}); use the backend onnx"
            ) from error

    def __call__(self, energies: Audio) -> Audio:
        """Return the embedding (channels, 2 width) of energies (channels, frames, 128).

        First the mean over all patches, then the maximum.
        """
        tokens = self.hidden(energies)[:, 2:]
        pooled = self._torch.cat([tokens.mean(dim=1), tokens.amax(dim=1)], dim=1)
        return pooled.cpu().numpy()

    def hidden(self, energies: Audio) -> "Tensor":
        """Return the last hidden state (channels, 2 + patches, width): two tokens first, then the patches."""
        torch, t = self._torch, self._tensors
        functional = torch.nn.functional
        with torch.inference_mode():
            seen = torch.from_numpy(patches_of(energies)).to(self._device)
            patches = functional.linear(seen, t["patch.weight"], t["patch.bias"])
            first = torch.stack([t["cls"], t["distillation"]]).expand(len(seen), -1, -1)
            state = torch.cat([first, patches], dim=1) + t["positions"]
            for layer in range(self._depth):
                state = state + self._attended(f"layers.{layer}", self._even(state, f"layers.{layer}.before"))
                up = self._linear(self._even(state, f"layers.{layer}.after"), f"layers.{layer}.up")
                state = state + self._linear(functional.gelu(up), f"layers.{layer}.down")
            return self._even(state, "final")

    def _attended(self, name: str, state: "Tensor") -> "Tensor":
        count, tokens, width = state.shape
        qkv = self._linear(state, f"{name}.qkv").view(count, tokens, 3, self._heads, HEAD)
        query, key, value = qkv.permute(2, 0, 3, 1, 4)
        heads = self._torch.nn.functional.scaled_dot_product_attention(query, key, value)
        return self._linear(heads.transpose(1, 2).reshape(count, tokens, width), f"{name}.out")

    def _linear(self, state: "Tensor", name: str) -> "Tensor":
        weight, bias = self._tensors[f"{name}.weight"], self._tensors[f"{name}.bias"]
        return self._torch.nn.functional.linear(state, weight, bias)

    def _even(self, state: "Tensor", name: str) -> "Tensor":
        weight, bias = self._tensors[f"{name}.weight"], self._tensors[f"{name}.bias"]
        return self._torch.nn.functional.layer_norm(state, weight.shape, weight, bias, EPSILON)


def _torch() -> Any:
    try:
        import torch  # noqa: PLC0415
    except ImportError as error:
        given = "the encoder's backend torch (PyTorch is not installed)"
        raise InputError(given, "onnx, int8", "pip install 'monochord[train]'") from error
    return torch
