"""`sessions import` of a folder in the form `wav_csv`."""

from tests.fuzz.targets._imports import ImportTarget


class Fuzz(ImportTarget):
    """A folder that `sessions export wav_csv` wrote."""

    form = "wav_csv"
