import pytest

from monochord.capture.jack import libjack
from monochord.core.errors import DeviceError


@pytest.fixture
def forgetful() -> None:
    libjack.path.cache_clear()


def test_every_function_is_there() -> None:
    try:
        jack = libjack.library()
    except DeviceError as error:
        pytest.skip(str(error))
    assert jack.jack_get_sample_rate.argtypes == [libjack.c_void_p]


@pytest.mark.usefixtures("forgetful")
def test_without_the_library_there_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libjack, "NAMES", ("libjack-that-nobody-has.so.0",))
    with pytest.raises(DeviceError, match="libjack: not found; start JACK"):
        libjack.path()
