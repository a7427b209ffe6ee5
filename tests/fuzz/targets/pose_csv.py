"""A CSV file of poses that grows while it is read, and is now and then written anew."""

from collections.abc import Iterator
from pathlib import Path

from tests.fuzz.base import Input, Target, given_file
from tests.fuzz.targets._feeds import recorded

from monochord.capture.instruments.pose_csv import PoseCsv


class Fuzz(Target):
    """Lines in pieces, from the start or from the end on."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        for head, more in (("time,x,y,z", ""), ("Time, x,y,z,qx,qy,qz,qw", ",0,0,0,1"), ("n,time,x,y,z", "")):
            first = "7," if head[0] == "n" else ""
            lines = [f"{first}{0.01 * k:g},0.1,0,{-0.01 * k:g}{more}" for k in range(30)]
            yield {"pose.csv": "\n".join((head, *lines, "")).encode()}

    def run(self, folder: Path) -> None:
        file = given_file(folder, "pose.csv")
        data = file.read_bytes()
        third = len(data) // 3
        parts = [data[third : 2 * third], data[2 * third :], b""]
        file.write_bytes(data[:third])

        def feed() -> None:
            if parts:
                with file.open("ab") as stream:
                    stream.write(parts.pop(0))
            else:
                file.with_name("new").write_bytes(data)
                file.with_name("new").rename(file)

        from_start = len(data) % 2 == 0
        out = folder.with_name("take.mcap")
        recorded(
            PoseCsv(path=str(file), from_start=from_start),
            out,
            max_readings=2 * data.count(b"\n") + 2,
            feed=feed,
        )
