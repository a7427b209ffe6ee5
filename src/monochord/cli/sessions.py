"""The command `sessions`: checks, shows, repairs, converts and resamples recordings, lists touches."""

import dataclasses
import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from monochord.capture.recording.from_files import from_files
from monochord.capture.recording.label_table import KNOWN_LABELS, LABELS
from monochord.capture.recording.settings import of_sensor
from monochord.capture.sources.base import MAX_RATE, MIN_RATE
from monochord.cli._label import label
from monochord.cli._options import radius, refuse_unwritable, sensor_option, set_option, truncated_option
from monochord.cli._output import echo
from monochord.cli.figure import SUFFIXES
from monochord.core.config import override, to_tree
from monochord.core.errors import InputError
from monochord.core.files import replacing, write_text
from monochord.core.ownership import part_folder
from monochord.figures import FIGURES
from monochord.live.touches import robot_positions, touch_spans, touch_table
from monochord.physics.strings import load_string
from monochord.sessions import check as check_session
from monochord.sessions import read_session
from monochord.sessions import recover as recover_session
from monochord.sessions.alignment import Lateness, align
from monochord.sessions.exports import EXPORTS, form_of
from monochord.sessions.exports.base import new_folder
from monochord.sessions.facts import facts_lines, facts_of
from monochord.sessions.resample import resample as resample_session

FILE = click.Path(path_type=Path)
USUAL_RATE = 44100
OVERVIEW = "session"  # the figure that shows one
some_files = click.argument("files", type=FILE, nargs=-1, required=True, metavar="FILES...")
json_lines = click.option("--json", "as_json", is_flag=True, help="Print one JSON object per file.")
json_object = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


@click.group()
def sessions() -> None:
    """Check, show, repair, convert and label recorded sessions.

    A session is one .mcap file with audio, instruments and labels on one clock.

    \b
    monochord sessions show session.mcap
    monochord sessions export wav-csv session.mcap --out tables
    """  # noqa: D301


@sessions.command()
@some_files
@click.option("--strict", is_flag=True, help="Count faults of the recording as bad too.")
@json_lines
def check(files: tuple[Path, ...], *, strict: bool, as_json: bool) -> int:
    """Check that session files are whole and unchanged.

    FILES are read to the end, and each gets one line. A file is bad if it is damaged, cut off or changed
    since it was written; the exit status is then 2. Faults of the recording, such as lost frames, a clock
    that jumped, or streams whose taps are too far apart, are noted at the end of the line. With --strict they
    count as bad too.

    \b
    monochord sessions check session.mcap
    monochord sessions check sessions/*.mcap
    """  # noqa: D301

    def result(file: Path) -> tuple[bool, dict[str, Any], str]:
        report, alignment = check_session(file), align(read_session(file))
        notes = [*report.remarks, *alignment.flags]
        good = report.sound and not (strict and notes)
        offsets = {stream: _known(late) for stream, late in alignment.lateness.items()}
        tree: dict[str, Any] = {
            **dataclasses.asdict(report),
            "path": str(file),
            "ok": good,
            "flags": list(alignment.flags),
            "offsets": offsets,
        }
        line = f"{'ok ' if good else 'bad'}  {report.seconds:9.1f} s  {report.content_checksum[:12]}  {file}"
        apart = ", ".join(f"{name} {1e3 * each[0]:+.2f} ms" for name, each in offsets.items() if each)
        notes = [*report.faults, *notes, *([f"against {alignment.reference}: {apart}"] if apart else [])]
        return good, tree, f"{line}: {'; '.join(notes)}" if notes else line

    return _each(files, result, as_json=as_json)


@sessions.command()
@click.argument("file", type=FILE)
@click.option(
    "--figure", type=FILE, metavar="FILE", help="Also draw the session into a .png, .pdf or .svg file."
)
@json_object
def show(file: Path, *, figure: Path | None, as_json: bool) -> None:
    """Show what a session contains.

    The lines list the recorded streams and instruments, their duration, and missing data.

    \b
    monochord sessions show session.mcap
    monochord sessions show session.mcap --figure session.png
    """  # noqa: D301
    if figure is not None:
        refuse_unwritable(figure, SUFFIXES)
    facts = facts_of(read_session(file))
    if figure is not None:
        with replacing(figure) as part:
            FIGURES.build(OVERVIEW, {"path": str(file)}).draw().savefig(part)
        facts["figure"] = str(figure)
    echo(*([json.dumps(facts)] if as_json else facts_lines(facts)))


@sessions.command()
@some_files
@json_lines
def recover(files: tuple[Path, ...], *, as_json: bool) -> int:
    """Repair session files that were cut off or damaged, in place.

    Whole files stay as they are. Damaged parts that are changed or removed are saved as FILE.cut; an
    unfinished last record is not. A file that is still being recorded is refused.

    \b
    monochord sessions recover session.mcap
    monochord sessions recover sessions/*.mcap --json
    """  # noqa: D301

    def result(file: Path) -> tuple[bool, dict[str, Any], str]:
        done = recover_session(file)
        if not done.repaired:
            line = f"{file}: whole, nothing to do ({done.seconds:.1f} s)"
        else:
            lost = (
                f"{done.lost_bytes} bytes of unfinished or damaged records lost"
                if done.lost_bytes
                else "nothing lost"
            )
            beside = f"; the changed bytes are saved in {done.cut}" if done.cut else ""
            line = f"{file}: repaired; {done.seconds:.1f} s in {done.messages} messages, {lost}{beside}"
        cut = str(done.cut) if done.cut else None
        return True, {**dataclasses.asdict(done), "path": str(file), "cut": cut}, line

    return _each(files, result, as_json=as_json)


@sessions.command()
@click.argument("form")
@some_files
@click.option("--out", type=FILE, required=True, metavar="DIR", help="New folder to write to.")
@set_option("monochord list exports")
@json_object
def export(
    form: str, files: tuple[Path, ...], *, out: Path, assignments: tuple[str, ...], as_json: bool
) -> None:
    """Export sessions in another format, into a new folder.

    FORM is a format of 'monochord list exports'.

    \b
    monochord sessions export wav-csv session.mcap --out tables
    monochord sessions export lerobot sessions/*.mcap --out robot --set fps=30
    """  # noqa: D301
    exporter = EXPORTS.build(form, override({}, assignments))
    whole = [read_session(file) for file in files]
    if out.exists():
        new_folder(out)  # which refuses one with something in it
    out.absolute().parent.mkdir(parents=True, exist_ok=True)
    with part_folder(out) as part:
        written = exporter.write(whole, part)
        size = sum(path.stat().st_size for path in written)
        part.rename(out)
    summary = {"form": form, "out": str(out), "sessions": len(files), "files": len(written), "bytes": size}
    line = (
        f"{out}: {_counted(len(files), 'session')} in {_counted(len(written), 'file')}, {size / 1e6:.1f} MB"
    )
    echo(json.dumps(summary) if as_json else line)


@sessions.command("import")
@click.argument("what", type=FILE, metavar="AUDIO|FOLDER")
@click.argument("labels", type=FILE, metavar="[LABELS.csv]", required=False)
@click.option("--out", type=FILE, required=True, metavar="FILE.mcap", help="Session to write.")
@click.option("--name", metavar="TEXT", help="Name of the session.  [default: the file's name]")
@click.option("--object", "object_", metavar="TEXT", help="Object that touches the string.")
@click.option("--material", metavar="TEXT", help="Material of the object.")
@click.option("--radius", type=radius, metavar="M", help="Radius of the object where it touches.")
@click.option(
    "--string", metavar="PRESET", help="String: a name from 'monochord list strings', or FILE.toml."
)
@sensor_option
@click.option("--notes", metavar="TEXT", help="Notes to save with the session.")
@truncated_option
@json_object
def import_(
    what: Path,
    labels: Path | None,
    *,
    out: Path,
    allow_truncated: bool,
    as_json: bool,
    **said: str | float | None,
) -> None:
    """Make a session from your own audio and labels.

    AUDIO is a WAV or FLAC file with 1 or 2 channels, or a session with audio only. The first line of
    LABELS.csv names its columns: time in s from the beginning of the audio, and any of contact (0 or 1),
    position (m), force (N), slip (0 or 1) and others. With columns begin and end in place of time, each row
    is a touch. Misspelt names of these columns, and impossible positions and forces, are refused; --sensor
    sets the string. FOLDER is an export from 'monochord sessions export'.

    \b
    monochord sessions import take.wav take.csv --out touches.mcap --object "Allen key"
    monochord sessions import tables/session --out copy.mcap
    """  # noqa: D301
    refuse_unwritable(out, (".mcap",))
    described: dict[str, Any] = {name.rstrip("_"): value for name, value in said.items() if value is not None}
    if what.is_dir():
        more = [*described, *(["allow-truncated"] if allow_truncated else [])]
        if labels is not None or more:
            given = f"folder {what} with {labels or ', '.join(f'--{name}' for name in more)}"
            raise InputError(given, "a folder alone", "the folder describes itself")
        EXPORTS.build(form_of(what)).read(what, out)
    else:
        _put_string(described)
        from_files(what, labels, out, described=described, allow_truncated=allow_truncated)
    session = read_session(out)
    others = [name for name in session.labels.columns if name not in KNOWN_LABELS]
    if labels is not None and others:
        echo(f"{labels}: kept as further labels: {', '.join(others)}; known: {', '.join(LABELS)}", err=True)
    facts = facts_of(session)
    echo(*([json.dumps(facts)] if as_json else facts_lines(facts)))


def _put_string(described: dict[str, Any]) -> None:
    """Replace the names of sensor and string in a description by what they stand for."""
    if "string" in described and "sensor" in described:
        raise InputError("--string with --sensor", "only one of them", "a sensor has its own string")
    if "sensor" in described:
        described |= of_sensor(str(described["sensor"]))
        described["string"] = to_tree(described["string"])
    elif "string" in described:
        described["string"] = to_tree(load_string(str(described["string"])).string)


@sessions.command()
@click.argument("file", type=FILE)
@click.option(
    "--rate",
    type=click.IntRange(MIN_RATE, MAX_RATE),
    default=USUAL_RATE,
    show_default=True,
    metavar="HZ",
    help="The new sample rate.",
)
@click.option("--out", type=FILE, required=True, metavar="FILE.mcap", help="Session to write.")
@json_object
def resample(file: Path, *, rate: int, out: Path, as_json: bool) -> None:
    """Copy a session at another sample rate.

    Everything but the sound stays the same. A model reads sound at the rate of its training: live, locate,
    calibrate and evaluate resample to it, and build to the lowest rate of its sessions. Sound that was
    recorded at a lower rate lacks the highest frequencies, which a model may take for another sensor: record
    at the model's rate or above.

    \b
    monochord sessions resample session.mcap --out slow.mcap --rate 22050
    monochord sessions resample slow.mcap --out usual.mcap
    """  # noqa: D301
    refuse_unwritable(out, (".mcap",))
    resample_session(read_session(file), out, rate)
    facts = facts_of(read_session(out))
    echo(*([json.dumps(facts)] if as_json else facts_lines(facts)))


@sessions.command()
@click.argument("recording", type=FILE)
@click.option("--out", type=FILE, required=True, metavar="FILE.csv", help="Table to write.")
@click.option(
    "--model", metavar="NAME", default="demo", show_default=True, help="Model that detects contact."
)
@sensor_option
@truncated_option
@json_object
def touches(
    recording: Path, *, out: Path, model: str, sensor: str | None, allow_truncated: bool, as_json: bool
) -> None:
    """List the touches in a recording as a table to fill in.

    Each row is a touch, with its begin and end in s from the beginning of RECORDING. Fill in the position in
    m from pickup 1 and the force in N, as read from a ruler and a scale. If a robot's pose was recorded, the
    positions are filled in: its x is the position. Delete rows that are not your touches. Then make a session
    of the recording and the table, and calibrate with it.

    \b
    monochord sessions touches take.mcap --out touches.csv
    monochord sessions import take.mcap touches.csv --out touches.mcap
    """  # noqa: D301
    refuse_unwritable(out, (".csv",))
    if out.exists():
        raise InputError(f"file '{out}' (exists, and may be filled in)", "a new file")
    spans = touch_spans(recording, model, sensor=sensor or "", allow_truncated=allow_truncated)
    positions = robot_positions(recording, spans)
    write_text(out, touch_table(spans, positions))
    if as_json:
        echo(json.dumps({"path": str(out), "touches": [{"begin": a, "end": b} for a, b in spans]}))
        return
    missing = "force (N)" if positions else "position (m from pickup 1) and force (N)"
    words = ["monochord", "sessions", "import", str(recording), str(out)]
    labelled = out.with_suffix(".mcap")
    labelled = labelled.with_stem(f"{out.stem}_labelled") if labelled.exists() else labelled
    words += ["--out", str(labelled), *(["--sensor", sensor] if sensor else [])]
    words += ["--allow-truncated"] if allow_truncated else []
    echo(f"{out}: {_counted(len(spans), 'touch')}; fill in {missing}", f"then: {shlex.join(words)}")


sessions.add_command(label)
Result = Callable[[Path], tuple[bool, dict[str, Any], str]]


def _each(files: tuple[Path, ...], result: Result, *, as_json: bool) -> int:
    """Print the result for each file; an unusable file does not stop the others."""
    status = 0
    for file in files:
        try:
            good, tree, line = result(file)
        except InputError as error:
            good, tree, line = False, {"path": str(file), "ok": False, "error": str(error)}, ""
            echo(f"monochord: {error}", err=True)
        status = status if good else 2
        if as_json or line:
            echo(json.dumps(tree) if as_json else line)
    return status


def _known(late: Lateness) -> list[float]:
    """Return a stream's delay at the start and the end, in s, as far as known."""
    return [offset.value for offset in late.offsets if offset.is_determined]


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 'es' if noun.endswith('ch') else 's'}"
