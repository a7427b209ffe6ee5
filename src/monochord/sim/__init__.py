"""A string in the simulators in which robots are taught: MuJoCo scenes and Gymnasium environments.

Install with the extra `sim`. What a simulator's contacts do to a string leads a virtual sensor of its own,
whose sound is heard as a real sensor's sound is. All of it is simulated.

``import monochord.sim`` registers the Gymnasium environments where Gymnasium is installed, so that
``gymnasium.make("monochord/Touch-v0")`` makes one; ``gymnasium.make("monochord.sim:monochord/Touch-v0")``
does both in one line. ``monochord/Grasp-v0`` is the other one.
"""

from importlib.util import find_spec

if find_spec("gymnasium") is not None:
    from monochord.sim.registration import register

    register()
