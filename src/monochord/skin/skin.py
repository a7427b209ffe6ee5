"""Several strings on one link: read from a file, run together, and combined at each instant."""

import math
from collections.abc import Generator, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from monochord.core.config import from_tree, load_toml, to_tree
from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import Checked, checked
from monochord.core.reasons import Reason
from monochord.core.types import Estimate, NamedEstimates, Prediction
from monochord.core.units import Seconds
from monochord.live.listen import Answering, Listenable, live_run
from monochord.live.loop import opened
from monochord.live.settings import LiveRun, StringSettings, channels_of
from monochord.live.update import Update
from monochord.physics.twin.virtual_sensors import VirtualSensors
from monochord.skin.geometry import Neighbours, SkinString, neighbours
from monochord.skin.update import SkinContact, SkinUpdate, contact_of
from monochord.skin.urdf import refuse_other_link

CONTACT, POSITION = "contact", "position"
IN_CONTACT = 0.5
"""Probability above which a window alone is in contact."""


@dataclass(frozen=True, kw_only=True)
class Skin(Checked):
    """Strings on one link of a robot.

    Parameters
    ----------
    link
        Name of the link, in whose frame the strings' ends are.
    strings
        The strings by name: a letter, then letters, digits and underscores.
    name
        Name of the skin.

    Raises
    ------
    InputError
        For a string whose ends coincide, or are not as far apart as its sensor's string is long, whose press
        is along it, or which has a channel of another.

    Examples
    --------
    >>> left = SkinString(start=(0.03, 0, 0), end=(0.03, 0, 0.2), press=(-1, 0, 0), sensor="prototype")
    >>> right = SkinString(start=(-0.03, 0, 0), end=(-0.03, 0, 0.2), press=(1, 0, 0), sensor="prototype")
    >>> skin = Skin(link="fingertip", strings={"left": left, "right": right})
    >>> [f"{1e3 * each.distance:.0f} mm apart" for each in skin.neighbours]
    ['60 mm apart']
    """

    link: str
    strings: Mapping[str, SkinString]
    name: str = "skin"

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if not self.link or not self.strings:
            given = "no strings" if self.link else "no link"
            raise InputError(f"skin {self.name} with {given}", "a link and strings")
        channels_of(self.settings)
        for name, each in self.strings.items():
            each.check(name)

    @property
    def settings(self) -> dict[str, StringSettings]:
        """The strings as a live run takes them: channels and sensor of each."""
        return {
            name: StringSettings(channels=each.channels, sensor=each.sensor)
            for name, each in self.strings.items()
        }

    @property
    def neighbours(self) -> tuple[Neighbours, ...]:
        """The pairs of strings between which no other lies."""
        return tuple(neighbours(self.strings))

    @checked
    def combine(self, estimates: Mapping[str, NamedEstimates]) -> SkinUpdate:
        """Return the contacts, the wrench, and what is withheld, of the strings' estimates of one instant.

        Of an `Update`, the estimates over time and the decision on contact count; else a window's estimates,
        where a probability above 0.5 is a contact. A string without estimates is withheld.

        Parameters
        ----------
        estimates
            An `Update`, `Prediction` or `Tracked` by the string's name.

        Raises
        ------
        InputError
            For the name of a string that the skin does not have.

        Examples
        --------
        >>> from monochord import Estimate, Prediction, SkinString
        >>> string = SkinString(start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), sensor="prototype")
        >>> skin = Skin(link="fingertip", strings={"top": string})
        >>> values = {"contact": (1.0, 0.1, ""), "position": (0.08, 3e-4, "m"), "force": (1.5, 0.2, "N")}
        >>> told = {name: Estimate(value=v, std=s, unit=unit) for name, (v, s, unit) in values.items()}
        >>> update = skin.combine({"top": Prediction(start=0, time=0.0, estimates=told)})
        >>> update.contacts[0].point, update.wrench
        (array([0.08, 0.  , 0.  ]), array([ 0.  ,  0.  , -1.5 ,  0.  ,  0.12,  0.  ]))
        """
        for name in estimates:
            if name not in self.strings:
                known = ", ".join(self.strings)
                given = f"estimates of the string '{name}'"
                raise InputError(given, known, did_you_mean(name, self.strings))
        contacts, withheld = list[SkinContact](), dict[str, str]()
        for name, string in self.strings.items():
            if name not in estimates:
                withheld[name] = Reason.NOT_ESTIMATED
                continue
            told = estimates[name]
            values = told.tracked if isinstance(told, Update) else told
            touched = _touched(told)
            if isinstance(touched, str):
                withheld[name] = touched
            elif touched:
                contact = contact_of(name, string, values.position, values.force)
                contacts.append(contact)
                for each in (contact.force, contact.position):
                    if not each.valid:
                        withheld[name] = each.reason or Reason.NOT_GIVEN
        times = [each.time for each in estimates.values() if isinstance(each, (Prediction, Update))]
        return SkinUpdate.of(tuple(contacts), withheld, max(times, default=math.nan), estimates)

    def listen(
        self,
        source: Listenable = "jack",
        model: Answering = "demo",
        *,
        seconds: Seconds = math.inf,
        hop: Seconds = 0.01,
        window: Seconds | None = None,
        **options: object,
    ) -> Iterator[SkinUpdate]:
        """Yield an update of the whole skin for every window of a source that has all its strings' channels.

        This is `monochord.listen` for several strings at once, with its arguments. A recording or an array
        has the channels that the skin's file states; a `VirtualSensors` has a sensor for each string, two
        channels each, in their order.

        Examples
        --------
        >>> import monochord as mc
        >>> bottom = SkinString(start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, 1), sensor="prototype")
        >>> top = SkinString(start=(0, 0, 0.02), end=(0.2, 0, 0.02), press=(0, 0, -1), sensor="prototype")
        >>> skin = Skin(link="fingertip", strings={"bottom": bottom, "top": top})
        >>> sensors = mc.VirtualSensors(count=2, seed=1)
        >>> for update in skin.listen(sensors, seconds=0.8):
        ...     if update.time == 0.0:
        ...         _ = sensors[1].press(0.09, 1.0)
        >>> [contact.string for contact in update.contacts], update.contacts[0].point.round(3).tolist()
        (['top'], [0.09, 0.0, 0.02])
        """
        if isinstance(source, VirtualSensors) and len(source) != len(self.strings):
            given = f"{len(source)} virtual sensors"
            raise InputError(given, f"{len(self.strings)}, one for each of {', '.join(self.strings)}")
        setup = live_run(source, model, seconds, hop, window, "", "", options, self.settings)
        return self._updates(setup)

    def _updates(self, setup: LiveRun) -> Generator[SkinUpdate]:
        with opened(setup) as live:
            instant = dict[str, Update]()
            for update in live:  # those of one window in the strings' order
                instant[update.string] = update
                if len(instant) == len(self.strings):
                    yield self.combine(instant)
                    instant = {}

    def tree(self) -> dict[str, Any]:
        """Return link, strings with their channels, and neighbours as plain values."""
        channels = channels_of(self.settings)
        strings = {name: {**to_tree(each), "channels": channels[name]} for name, each in self.strings.items()}
        pairs = [asdict(each) for each in self.neighbours]
        return {"link": self.link, "strings": strings, "neighbours": pairs}

    def lines(self) -> list[str]:
        """Return what a user must know of the skin's geometry, as text lines."""
        rows = [f"{self.name}: {len(self.strings)} strings on the link {self.link}"]
        for name, channels in channels_of(self.settings).items():
            low, high = (f"{1e3 * end:g}" for end in self.strings[name].loaded.range)
            listed = " and ".join(map(str, channels))
            rows.append(f"  {name}: channels {listed}, positions from {low} to {high} mm")
        return [*rows, *(f"  {each}" for each in self.neighbours)]


def _touched(told: NamedEstimates) -> bool | str:
    """Return whether a string is in contact, or the reason for which it is not known."""
    if isinstance(told, Update) and CONTACT in told.decided:
        return told.decided[CONTACT]
    values = told.tracked if isinstance(told, Update) else told
    contact: Estimate = values.contact
    if Reason.of(contact.reason) is Reason.NOT_ESTIMATED:  # by this estimator; a position tells of a touch
        return values.position.valid or values.position.reason
    if isinstance(told, Update) or not contact.valid:
        raw = told.contact
        return Reason.UNDECIDED if raw.valid else raw.reason or Reason.NOT_GIVEN
    return contact.value > IN_CONTACT


@dataclass(frozen=True, slots=True, kw_only=True)
class _SkinFile(Checked):
    """The contents of a skin's file."""

    link: str
    strings: Mapping[str, SkinString]


@checked
def load_skin(path: str | Path, robot: str | Path = "") -> Skin:
    """Read a skin from its file.

    The TOML file has the name of the ``link`` and a table ``[strings.NAME]`` for each string, with the fields
    of `SkinString`. A sensor's file is looked for beside it.

    Parameters
    ----------
    path
        The file.
    robot
        The robot's URDF, to check that it has the link; none by default.

    Raises
    ------
    InputError
        For a file that cannot be read, an unknown key, a value that no skin has (see `Skin`), or a link that
        the robot does not have.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "finger.toml")
    ...     _ = file.write_text('''
    ...     link = "fingertip"
    ...     [strings.top]
    ...     start = [0.0, 0.0, 0.02]
    ...     end = [0.2, 0.0, 0.02]
    ...     press = [0, 0, -1]
    ...     sensor = "prototype"
    ...     ''')
    ...     skin = load_skin(file)
    >>> skin.name, skin.link, list(skin.strings)
    ('finger', 'fingertip', ['top'])
    """
    file = Path(path)
    given = from_tree(_SkinFile, load_toml(file), f"skin {file.stem}")
    strings = {name: replace(each, sensor=_beside(file, each.sensor)) for name, each in given.strings.items()}
    skin = Skin(name=file.stem, link=given.link, strings=strings)
    if robot:
        refuse_other_link(skin.link, Path(robot))
    return skin


def _beside(file: Path, sensor: str) -> str:
    """Return a sensor's preset, or its file, whose path is relative to the skin's."""
    return str(file.parent / sensor) if sensor.endswith(".toml") else sensor
