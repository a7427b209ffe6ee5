"""Play a recording into a JACK server: FILE SERVER NAME; says ``ready`` and stays until stopped."""

import signal
import sys
import time

import numpy as np
import soundfile

from monochord.lab.player import Player


def main() -> None:
    file, server, name = sys.argv[1:]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    samples, rate = soundfile.read(file, always_2d=True)
    with Player(samples.T.astype(np.float32), rate, client_name=name, server=server) as player:
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        while not player.gone:
            time.sleep(0.05)


if __name__ == "__main__":
    main()
