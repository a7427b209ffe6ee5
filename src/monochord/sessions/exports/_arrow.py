"""The library that reads and writes Parquet, where it is installed."""

from typing import Any

from monochord.core.errors import InputError


def arrow(form: str) -> tuple[Any, Any]:
    """Return pyarrow and its Parquet part; raises `InputError` where they are not installed."""
    try:
        import pyarrow as pa  # noqa: PLC0415
        import pyarrow.parquet as pq  # noqa: PLC0415
    except ImportError as error:
        given = f"export {form} (pyarrow is not installed)"
        raise InputError(given, "wav_csv", "pip install 'monochord[export]'") from error
    return pa, pq
