"""Touch by the closed-form inverse of one segment, or of both."""

from monochord.perception.closed_form.hypotheses import (
    COMMON_MEASURES,
    MAX_MODE_1,
    PLACE_MEASURES,
    POSITION,
    SEGMENT_MEASURES,
    TRAINED_RISE,
    find_hypotheses,
    measure_hypotheses,
)
from monochord.perception.closed_form.modes import most_probable
from monochord.perception.closed_form.place_density import (
    CELLS,
    CHANNELS,
    DILATIONS,
    PLACES,
    STRIDES,
    PlaceNetwork,
    cells_of,
    density,
    measure_places,
)
from monochord.perception.closed_form.prominence import prominences
from monochord.perception.closed_form.ranking import MAX_DEVIATION, Ranking, probabilities
from monochord.perception.closed_form.spectrum import SpectrumAnalyser, string_model

__all__ = [
    "CELLS",
    "CHANNELS",
    "COMMON_MEASURES",
    "DILATIONS",
    "MAX_DEVIATION",
    "MAX_MODE_1",
    "PLACES",
    "PLACE_MEASURES",
    "POSITION",
    "SEGMENT_MEASURES",
    "STRIDES",
    "TRAINED_RISE",
    "PlaceNetwork",
    "Ranking",
    "SpectrumAnalyser",
    "cells_of",
    "density",
    "find_hypotheses",
    "measure_hypotheses",
    "measure_places",
    "most_probable",
    "probabilities",
    "prominences",
    "string_model",
]
