"""Physics of the string: closed forms, simulators, presets, and what they say of a design or a build.

A string is fixed at both ends and kept ringing by a driver on each side. An object that touches it at x with
the normal force F divides it into two segments, which share the tension: the ratio of their pitches tells x,
the rise of both tells F.

Conventions: SI units. Positions x are in m from the end at pickup 1, inside the string (0 < x < L); segment 1
is between pickup 1 and the touch. F is 0 or more; without a contact there is no `Contact`, rather than one of
0 N. Frequencies are in Hz unless said to be in rad/s. Every sound from here is simulated, and says so.

- `theory`: closed forms, each with its equation, when it holds, and its source. The others build on it.
- `strings`, `materials`, `sensors`: presets, one TOML file each, with its source.
- `setup`: what a virtual sensor is given: the sensor as built, and the touches and sounds around it.
- `split_string`: the paper's simulator of two independent segments. `twin`: the virtual sensor, in which the
  touched string is one, the touch slides and gives way, and the drivers are feedback loops.
- `simulators`: the registry of both, for `simulate` and for plug-ins.
- `lengthening`: by how much a compliant object or mount lowers the pitch of both segments.
- `design`: what a string would do as a sensor, before it is built. `identification`: what the partials of a
  build say about its tension, stiffness, density and magnets.
- `known_touches`: which places to touch for a calibration, and which labels are impossible.

>>> from monochord.physics.strings import load_string
>>> from monochord.physics.theory import open_frequency
>>> round(open_frequency(load_string("prototype").string))
1011
"""
