"""Whether two channels carry one note, or a segment each: a stereo recording of a string, or a sensor's.

Both are harmonic series at both channels. Of one note heard from two sides, each partial is louder at
whichever side it happens to be. Of two segments whose fundamentals are p and q times a common one, only
multiples of p and q are there, those of p alone louder at channel 1, those of q alone at channel 2.
"""

from dataclasses import dataclass, field
from math import gcd

import numpy as np

from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Samples
from monochord.dsp.pitch import Series
from monochord.dsp.spectrum import Analyser

TOP: Hertz = 12000.0
"""Highest frequency looked at."""
MIN_EXPLAINED = 0.35
"""Least share of each channel's power that a series of both explains. Two segments without a common
fundamental leave one channel 0.2 at most, on the twin at 33 places."""
MIN_LINES, CLEAR_LINES = 3, 4
"""Fewest lines that show one note, and fewest that show two segments."""
LINE_RANGE = 2.0e-4
"""Least power of a line, as a share of its channel's strongest."""
MIN_SHARE = 0.75
"""Least share of a segment's line at its own channel. Those of the twin have 0.95."""
LEAN = 0.1
"""Least share beyond a half of such a line once the channels are scaled to equal power: the gains of a
recording's channels may differ. Those of the twin have 0.2."""
MOST_PARTIALS, MOST_MULTIPLE = 40, 12
WIDTH = 2.5
"""Half width of a line in the taper's transform, in multiples of the resolution."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sides:
    """How the partials of a series lie at two channels.

    `numbers` (n,) of the strong partials; `share` (n,) of each one's power at channel 1, and `levelled` (n,),
    the same once both channels are scaled to equal power; `explained` (2,), the share of each channel's
    power that the series explains.
    """

    numbers: Floats
    share: Floats
    levelled: Floats
    explained: Floats

    @property
    def common(self) -> bool:
        """Whether the series explains what both channels carry."""
        return bool(self.explained.min() >= MIN_EXPLAINED)

    @property
    def one_note(self) -> bool:
        """Whether both channels carry one note, and no two segments have such sides."""
        return self.common and self.numbers.size >= MIN_LINES and not self._two_segments()

    @property
    def undecided(self) -> bool:
        """Whether one note and two segments both may have such sides; a note has its first partial."""
        few = 0 < self.numbers.size < CLEAR_LINES and self.numbers[0] == 1.0
        return bool(self.common and few and not self.one_note)

    def _two_segments(self) -> bool:
        """Return whether the sides are those of segments at some multiples of the series's fundamental."""
        multiples = range(1, MOST_MULTIPLE + 1)
        pairs = [(p, q) for p in multiples for q in multiples if gcd(p, q) == 1 and p != q]
        leans = ((self.share, MIN_SHARE), (self.levelled, 0.5 + LEAN))
        return any(self._fits(p, q, share, least) for p, q in pairs for share, least in leans)

    def _fits(self, p: int, q: int, share: Floats, least: float) -> bool:
        first, second = self.numbers % p == 0, self.numbers % q == 0
        at_first, at_second = share >= least, share <= 1.0 - least
        shown = np.any(first & at_first) and np.any(second & at_second)
        return bool(shown and np.all((first & second) | (first & at_first) | (second & at_second)))


NO_SIDES = Sides(numbers=np.empty(0), share=np.empty(0), levelled=np.empty(0), explained=np.zeros(2))
"""Of a window without a series."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SidesReader:
    """Measures how the partials of a series lie at the two channels of a window.

    >>> from monochord.dsp.pitch import PitchFinder
    >>> time = np.arange(4410) / 44100
    >>> partials = np.stack([np.sin(2 * np.pi * 220 * n * time) for n in range(1, 5)])
    >>> sound = np.array([[1.0, 0.3, 0.5, 0.2], [0.4, 0.9, 0.6, 0.7]]) @ partials
    >>> finder = PitchFinder(sample_rate=44100, size=4410, lowest=80.0, highest=800.0)
    >>> SidesReader(sample_rate=44100, size=4410).read(sound, finder.find(sound)[0]).one_note
    True
    """

    sample_rate: int
    size: Samples
    _analyser: Analyser = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        analyser = Analyser(sample_rate=self.sample_rate, size=self.size, top=TOP)
        object.__setattr__(self, "_analyser", analyser)

    def read(self, samples: Floats | Audio, series: Series) -> Sides:
        """Return the sides of the partials of a series in a window (2, size)."""
        analyser = self._analyser
        power = analyser.powers(samples)
        n = np.arange(1.0, MOST_PARTIALS + 1.0)
        partials = series.frequency * n * np.sqrt(1.0 + series.inharmonicity * n * n)
        n = n[partials < analyser.top]
        reach = int(np.ceil(WIDTH * analyser.resolution / analyser.spacing))
        bins = np.rint(partials[: n.size] / analyser.spacing).astype(int)
        near = np.clip(bins[:, np.newaxis] + np.arange(-reach, reach + 1), 0, power.shape[1] - 1)
        heights = power[:, near].max(axis=2)
        strong = (heights >= LINE_RANGE * power.max(axis=1, keepdims=True)).any(axis=0)
        explained = power[:, np.unique(near)].sum(axis=1) / np.maximum(power.sum(axis=1), 1e-30)
        levels = np.var(samples, axis=1)[:, np.newaxis]
        return Sides(
            numbers=n[strong],
            share=_first(heights * levels)[strong],
            levelled=_first(heights)[strong],
            explained=explained,
        )


def _first(powers: Floats) -> Floats:
    """Return the share of channel 1 in powers (2, n)."""
    return powers[0] / np.maximum(powers.sum(axis=0), 1e-30)
