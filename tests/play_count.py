"""Play a count of frames into a JACK server: SERVER LIFE FRAMES.

It says ``prepared`` and waits for a line; then ``ready``, once it is connected ``playing``, and when the
server has gone how many frames it handed over.

Frame k of the life n is k modulo 2^20 on the first microphone and n * 2^10 + k / 2^20 on the second, each
plus one and over 2^21, so that all are exact in 32 bits, none is zero and none clips.
"""

import signal
import sys
import time

import numpy as np

from monochord.lab.player import Player

RATE, BLOCK, SCALE = 44100, 1 << 20, 2.0**-21


def main() -> None:
    server, life, frames = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    index = np.arange(frames)
    samples = np.empty((2, frames), np.float32)
    samples[0] = (index % BLOCK + 1) * SCALE
    samples[1] = (life * 1024 + index // BLOCK + 1) * SCALE
    print("prepared", flush=True)  # noqa: T201  (it is read by whoever started this process)
    sys.stdin.readline()
    with Player(samples, RATE, server=server) as player:
        print("ready", flush=True)  # noqa: T201
        while not (player.gone or player.position):
            time.sleep(0.02)
        print("playing", flush=True)  # noqa: T201
        while not player.gone:
            time.sleep(0.02)
        print(player.position, flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
