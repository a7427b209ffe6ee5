"""A string in the simulators in which robots are taught: MuJoCo scenes and Gymnasium environments.

Install with the extra `sim`. What a simulator's contacts do to a string leads a virtual sensor of its own,
whose sound is heard as a real sensor's sound is. All of it is simulated.
"""
