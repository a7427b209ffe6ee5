"""Examines all steps of a bring-up: in which order, and what a fault leaves out."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from monochord.bringup.check import MICROPHONES, Check, Take, left_out
from monochord.bringup.drivers import DriverLock, driver_checks, feed_checks, lock_of
from monochord.bringup.inputs import (
    dropped_check,
    inputs_check,
    level_checks,
    order_check,
    rate_check,
    sensitivity,
    separation_check,
    silence_checks,
)
from monochord.bringup.noise import hum_checks, mains_rate_check, noise_checks
from monochord.bringup.string import decay_check, decay_of, measure_pluck, pitch_check, wire_check
from monochord.bringup.timing import drift_checks, latency_check
from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.units import Hertz
from monochord.perception.tuning.measurement import StringMeasurement
from monochord.physics.sensors import MAX_RETUNING, sensor_toml
from monochord.physics.theory import open_frequency
from monochord.physics.twin import Sensor

REHEARSAL = "Simulated: a rehearsal on the virtual sensor."
"""What every report of a rehearsal says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BringUp:
    """A sensor's bring-up: the checks in order, the measured pluck, and the takes and locks behind them."""

    design: str
    sensor: Sensor
    checks: tuple[Check, ...]
    pluck: StringMeasurement | None
    takes: Mapping[str, Take]
    locks: Mapping[str, DriverLock]
    time: str = ""

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return all(check.passed is not False for check in self.checks)

    @property
    def faults(self) -> tuple[str, ...]:
        """The named faults, each once, in order."""
        return tuple(dict.fromkeys(check.fault for check in self.checks if check.fault))

    @property
    def simulated(self) -> bool:
        """Whether a virtual sensor made the sound of any step: a rehearsal."""
        return any(take.simulated for take in self.takes.values())

    @property
    def verdict(self) -> str:
        """The faults, or that there is none, in a line that says where it is simulated."""
        faults = f"{len(self.faults)} fault(s): {', '.join(self.faults)}." if self.faults else "No fault."
        return f"{faults} {REHEARSAL}" if self.simulated else faults

    def toml(self) -> str | None:
        """Return the text of the sensor's file; None without a pitch, or at a wrong sample rate.

        Levels, gains and swapped inputs stand in comments: a sensor file has no place for them.
        """
        pluck = self.pluck
        if pluck is None or Reason.WRONG_RATE in self.faults:
            return None
        if abs(pluck.tuning.deviation(self.sensor.string)) > MAX_RETUNING:
            return None
        take = self.takes["pluck"]
        dead = {number for number in MICROPHONES if Reason.MICROPHONE_DEAD.with_detail(number) in self.faults}
        tuning = pluck.in_file(
            self.sensor.string,
            seconds=take.samples.shape[1] / take.sample_rate,
            time=self.time,
            source=take.source,
        )
        tuning = replace(tuning, microphones=tuple(each for each in MICROPHONES if each not in dead))
        notes = [
            f"{check.name}: {shown(check)}"
            for check in self.checks
            if check.name.startswith(("level of microphone", "tap beside")) or check.passed is False
        ]
        notes = [REHEARSAL, *notes] if self.simulated else notes
        return "".join(f"# {note}\n" for note in notes) + sensor_toml(self.design, tuning)


def number(check: Check) -> str:
    """Return a check's value with its unit as text, empty where there is none.

    >>> number(Check(step="quiet", name="sample rate", value=44100.0, unit="Hz"))
    '44100 Hz'
    """
    if check.value is None:
        return ""
    form = ".0f" if abs(check.value) >= 1e4 else ".4g"
    return f"{check.value:{form}} {check.unit}".strip()


def shown(check: Check) -> str:
    """Return a check's value, fault and advice as text.

    Examples
    --------
    >>> shown(Check(step="both", name="level", value=-12.34, unit="dBFS"))
    '-12.34 dBFS'
    """
    value = number(check)
    if check.passed is None:
        value = "left out"
    text = ": ".join(part for part in (check.fault, check.advice) if part)
    return "; ".join(part for part in (value, text) if part)


def examine(design: str, sensor: Sensor, takes: Mapping[str, Take], *, time: str = "") -> BringUp:
    """Return the bring-up of a sensor from the sound of its steps, by name.

    Missing steps are left out, and so are checks that another fault makes meaningless: those of a dead
    microphone, of the string's pitch at a wrong rate, and of the wire of a string that does not ring.

    Parameters
    ----------
    design
        Name of the sensor's design.
    sensor
        The design.
    takes
        The sound of each step, at one rate.
    time
        When it was measured, in ISO 8601.

    Raises
    ------
    InputError
        If there is no take, one has other than two channels, is shorter than 1 s, or their rates differ.
    """
    _refuse(takes)
    string = sensor.string
    quiet, pluck_take, both = (takes.get(step) for step in ("quiet", "pluck", "both"))
    checks = [rate_check(takes), dropped_check(takes), inputs_check(takes)]
    wrong_rate = quiet is not None and mains_rate_check(quiet)
    if wrong_rate:
        checks[0] = wrong_rate
    is_wrong = checks[0].passed is False
    dead: set[int] = set()
    pluck: StringMeasurement | None = None
    if pluck_take:
        silence = silence_checks(pluck_take, quiet)
        dead = {number for number, check in zip(MICROPHONES, silence, strict=True) if check.passed is False}
        checks += silence
        pluck = measure_pluck(pluck_take, sensor) if len(dead) < len(MICROPHONES) else None
    else:
        checks.append(left_out("pluck", "microphones over their noise", "no recording"))
    hears = len(dead) < len(MICROPHONES)
    pitch = pluck.tuning.frequency if pluck else open_frequency(string)
    string_checks = (
        _string(pluck_take, pluck, sensor, is_wrong=is_wrong, is_silent=not hears) if pluck_take else []
    )
    is_loose = any(Reason.of(check.fault) is Reason.LOOSE_END for check in string_checks)
    decay = decay_of(pluck_take) if pluck_take and pluck and not is_loose else None
    drivers, locks = _drivers(takes, sensor, pitch, decay, hears=hears)
    if is_loose:
        reason = "the string does not ring: mend its ends first"
        drivers = [left_out(each.step, each.name, reason) if each.fault else each for each in drivers]
    is_driven = not (is_loose or any(check.fault for check in drivers))
    driven = [takes[step] for step in ("both", "press") if step in takes]
    levels = _both_alive(level_checks(driven), dead) if driven else []
    if not is_driven:
        reason = "a driver does not work: mend it first"
        levels = [
            left_out(each.step, each.name, reason) if Reason.of(each.fault) is Reason.LOW else each
            for each in levels
        ]
    unset = {each.microphone for each in levels if each.fault}
    feed: list[Check] = []
    if "damped" in takes and both and "both" in locks:
        feed = _both_alive(feed_checks(takes["damped"], both, quiet), dead | unset)
    is_clean = is_driven and not any(check.fault for check in feed)
    checks += [*levels, *_inputs(takes, dead, unset, is_clean=is_clean)]
    if quiet:
        noise = _both_alive(noise_checks(quiet, both if is_driven else None), dead | unset)
        checks += [*_both_alive(hum_checks(quiet), dead), *noise]
    checks += [*string_checks, *drivers, *feed]
    checks += [latency_check(takes.get("loopback")), *drift_checks(takes.get("drift"), pitch)]
    return BringUp(
        design=design, sensor=sensor, checks=tuple(checks), pluck=pluck, takes=takes, locks=locks, time=time
    )


def _refuse(takes: Mapping[str, Take]) -> None:
    if not takes:
        raise InputError("no recording of any step", "one for each step, such as pluck.wav")
    rates = {take.sample_rate for take in takes.values()}
    if len(rates) > 1:
        raise InputError(
            f"recordings at {', '.join(map(str, sorted(rates)))} Hz", "one sample rate for all steps"
        )
    for step, take in takes.items():
        channels, frames = take.samples.shape
        if channels != len(MICROPHONES):
            raise InputError(f"{step} with {channels} channel(s)", "2: one for each microphone")
        if frames < take.sample_rate:
            raise InputError(f"{step} of {frames / take.sample_rate:.2g} s", "1 s or more", "record it again")
        if not np.isfinite(take.samples).all():
            raise InputError(f"{step} with samples that are not finite", "numbers", "record it again")


def _drivers(
    takes: Mapping[str, Take], sensor: Sensor, pitch: Hertz, decay: float | None, *, hears: bool
) -> tuple[list[Check], dict[str, DriverLock]]:
    """Return the checks of the drivers, each alone and both, and how the string locks in each step."""
    checks: list[Check] = []
    locks: dict[str, DriverLock] = {}
    absent = {f"driver_{d}" for d, each in enumerate(sensor.drivers, 1) if not each.gain * each.limit}
    for step in ("driver_1", "driver_2", "both"):
        if step in absent:
            checks.append(left_out(step, step.replace("_", " "), "the design has none"))
            continue
        if step not in takes or not hears:
            reason = "no microphone hears it" if step in takes else "no recording"
            checks.append(left_out(step, step.replace("_", " "), reason))
            continue
        lock = lock_of(takes[step], pitch, takes.get("quiet"))
        locks |= {step: lock} if lock else {}
        checks += driver_checks(step, lock, pitch, decay)
    return checks, locks


def _both_alive(checks: list[Check], dead: set[int]) -> list[Check]:
    """Return the checks, those of microphones that are dead or not set yet left out."""
    return [
        left_out(check.step, check.name, "the microphone is dead, or its gain is to be set first")
        if check.microphone in dead
        else check
        for check in checks
    ]


def _inputs(takes: Mapping[str, Take], dead: set[int], unset: set[int], *, is_clean: bool) -> list[Check]:
    """Return which input is which, and how well the two are separated, where both microphones are set up."""
    names = {"tap": "tap beside microphone 1, over microphone 2", "press": "separation of the microphones"}
    pluck = takes.get("pluck")
    if dead or unset or pluck is None:
        reason = "a microphone is dead" if dead else "gains first" if unset else "no recording of the pluck"
        return [left_out(step, name, reason) for step, name in names.items()]
    relative = sensitivity(pluck)
    checks: list[Check] = []
    if tap := takes.get("tap"):
        checks.append(order_check(tap, relative))
    if press := takes.get("press"):
        checks.append(
            separation_check(press, relative)
            if is_clean
            else left_out("press", names["press"], "a driver is to be mended first")
        )
    return checks


def _string(
    take: Take, pluck: StringMeasurement | None, sensor: Sensor, *, is_wrong: bool, is_silent: bool
) -> list[Check]:
    if is_wrong or is_silent:
        reason = "no microphone hears it" if is_silent else "the sample rate is wrong: set it first"
        return [left_out("pluck", name, reason) for name in ("open pitch", "wire and ends")]
    decay = decay_check(decay_of(take), sensor)
    wire, pitch = wire_check(pluck, sensor.string), pitch_check(pluck, sensor.string)
    if decay.passed is False:
        reason = "the string does not ring long enough"
        wire = left_out("pluck", wire.name, reason)
        pitch = pitch if pluck else left_out("pluck", pitch.name, reason)
    return [pitch, wire, decay]
