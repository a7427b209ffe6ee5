"""What a model makes of sessions on other strings."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.perception.tuning.sessions import heard_by
from monochord.physics.strings import load_string

DESIGN, SOUND = load_string("prototype").string, np.zeros((2, 44100), np.float32)


def test_a_session_on_a_longer_string_is_refused() -> None:
    listen = heard_by(DESIGN)
    with pytest.raises(InputError, match=r"a string of 0\.65 m for a model: allowed is 0\.2 m"):
        listen(SOUND, 44100, replace(DESIGN, length=0.65))


def test_one_of_nearly_the_same_length_or_that_names_none_is_listened_to() -> None:
    for design, string in ((DESIGN, replace(DESIGN, length=0.203)), (DESIGN, None), (None, DESIGN)):
        assert heard_by(design)(SOUND, 44100, string) is None  # silence tells no tension
