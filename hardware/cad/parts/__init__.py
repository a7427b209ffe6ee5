"""One part a file, each with `build(hardware)`: the part in its own coordinates, as the assembly turns it."""
