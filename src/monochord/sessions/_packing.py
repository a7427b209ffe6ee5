"""Chunks that other programs compressed."""

from collections.abc import Callable

MAX_UNPACKED_CHUNK = 64 << 20
"""Largest unpacked size of a compressed chunk in bytes; a chunk that claims more counts as damaged.

An uncompressed chunk is not copied and may have any size.
"""


def unpacked(compression: str, packed: memoryview, size: int) -> memoryview | None:
    """Return the unpacked bytes, or None where they are damaged or not of the stated size."""
    if not compression:
        return packed
    unpack = _UNPACK.get(compression)
    if unpack is None or size > MAX_UNPACKED_CHUNK:
        return None
    try:
        data = unpack(packed, size)
    except Exception:  # noqa: BLE001  (each library has errors of its own: damage)
        return None
    return None if data is None else memoryview(data)


def _unpacked_zstd(packed: memoryview, size: int) -> bytes | None:
    import zstandard  # noqa: PLC0415

    # A size in the data's own head is what the library would allocate, whatever limit it is given.
    if zstandard.frame_content_size(packed) not in (size, -1):
        return None
    return zstandard.decompress(packed, max_output_size=size)


def _unpacked_lz4(packed: memoryview, size: int) -> bytes | None:
    import lz4.frame  # noqa: PLC0415

    stream = lz4.frame.LZ4FrameDecompressor()
    data = stream.decompress(packed, max_length=size + 1)
    return data if stream.eof else None


def unreadable(compression: str, size: int) -> bool:
    """Return whether a chunk that cannot be unpacked here may be intact: unknown compression, or too large.

    A known compression's name with one wrong character counts as damaged.
    """
    near = any(
        len(name) == len(compression) and sum(a != b for a, b in zip(name, compression, strict=True)) == 1
        for name in _UNPACK
    )
    return size > MAX_UNPACKED_CHUNK if compression in _UNPACK else bool(compression) and not near


_UNPACK: dict[str, Callable[[memoryview, int], bytes | None]] = {
    "zstd": _unpacked_zstd,
    "lz4": _unpacked_lz4,
}
"""Decompressors by compression name."""
