"""The picture of markers, drawn without ROS."""

from pathlib import Path

import pytest
from studies.ros_scene import RosScene, scene

from monochord.core.errors import InputError


def test_a_python_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="make ros"):
        scene(str(tmp_path / "python"), {})


@pytest.mark.slow
@pytest.mark.real_time
def test_three_moments_are_drawn() -> None:
    pytest.importorskip("matplotlib")
    if not Path(RosScene().python).is_file():
        pytest.skip("no Python with rclpy (make ros)")
    shown = RosScene().draw().axes
    texts = [{text.get_text() for text in axes.texts} for axes in shown]
    assert texts[0] == {"untouched"}
    assert "untouched" in texts[1]
    assert any("mm" in text for text in texts[1])
    assert "position: outside the sensing range" in texts[2]
