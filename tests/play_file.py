"""Play recordings into JACK servers: each line of standard input, [FILE, SERVER, NAME], starts a process.

Its number is printed once its ports are there; it plays until its server goes or it is terminated.
"""

import json
import os
import signal
import sys
import time

import numpy as np
import soundfile

from monochord.lab.player import Player


def play(file: str, server: str, name: str) -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    samples, rate = soundfile.read(file, always_2d=True)
    with Player(samples.T.astype(np.float32), rate, client_name=name, server=server) as player:
        sys.stdout.write(f"{os.getpid()}\n")
        sys.stdout.flush()
        while not player.gone:
            time.sleep(0.05)


def main() -> None:
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for them
    for line in sys.stdin:
        if os.fork() == 0:
            return play(*json.loads(line))
    return None


if __name__ == "__main__":
    main()
