"""`sessions import` of a folder in the form `parquet`."""

from tests.fuzz.targets._imports import ImportTarget


class Fuzz(ImportTarget):
    """A folder that `sessions export parquet` wrote."""

    form = "parquet"
