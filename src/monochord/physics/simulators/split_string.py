"""The paper's simulator."""

from dataclasses import dataclass
from math import isnan

from monochord.core.config import from_tree, override, to_tree
from monochord.physics.simulators.base import Case, Simulator, Sound, expected_peaks
from monochord.physics.split_string import Route, SplitString, peaks, simulate


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitStringSimulator(Simulator):
    """Two independent, driven segments: `monochord.physics.split_string`.

    Parameters
    ----------
    route
        "fdtd", "modal" or "reference": three methods for the same physics.
    sample_rate
        Sample rate of the sound, in Hz.
    """

    route: Route = "fdtd"
    sample_rate: int = 44100

    @classmethod
    def setup(cls) -> type:
        """Return the dataclass of the setup."""
        return SplitString

    def run(self, case: Case) -> Sound:
        """Simulate, and find the two dominant peaks after the transient."""
        plain = SplitString(string=case.string, contact=case.contact)
        setup = from_tree(SplitString, override(to_tree(plain), case.assignments))
        recording = simulate(setup, case.seconds, route=self.route, sample_rate=self.sample_rate)
        measured = [None if isnan(peak) else peak for peak in peaks(recording)]
        return Sound(
            microphones=recording.microphones,
            sample_rate=self.sample_rate,
            summary={
                "position": setup.contact.position if setup.contact else None,
                "force": setup.contact.force if setup.contact else None,
                "peaks": measured,
                "theory": list(expected_peaks(setup.string, setup.contact, setup.tension_law)),
                "route": self.route,
            },
        )
