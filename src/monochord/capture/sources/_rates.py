"""The sample rates that Monochord takes: a string's partials need 16 kHz, and 96 kHz is ample."""

from monochord.core.errors import InputError

LOWEST, HIGHEST = 16_000, 96_000


def refuse_other_rates(sample_rate: float, what: str, remedy: str) -> None:
    """Raise `InputError` for a sample rate below 16 kHz or above 96 kHz."""
    if not LOWEST <= sample_rate <= HIGHEST:
        raise InputError(f"{what} at {sample_rate:g} Hz", f"{LOWEST} to {HIGHEST} Hz", remedy)
