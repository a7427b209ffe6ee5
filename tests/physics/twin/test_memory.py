"""Names of columns and the arrays they belong to agree."""

from tests.physics.twin.built import PLASTIC, SENSOR, fixed, moving

from monochord.physics.twin import Scene, begin, hold, memory, stream


def test_arrays_have_room_for_what_their_names_say() -> None:
    twin = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),)))
    assert memory.Sensor._fields == stream.FIXED
    assert memory.State._fields == stream.MOVING
    assert moving(twin)["contact"].shape == (1, memory.TOUCH_MEMORY)
    assert moving(twin)["memory"].shape == (memory.SENSOR_MEMORY,)
    assert moving(twin)["solved"].shape == (1, memory.FOUND)
    assert fixed(twin)["touches"].shape == (1, memory.ROLLS + 1)
    assert fixed(twin)["scalars"].shape == (memory.AGREED + 1,)
    assert fixed(twin)["scalars"][memory.LENGTH] == SENSOR.string.length
