"""The command `monochord`: nothing but the command line, with Control-C taken before that is loaded."""

import os
import signal
import sys
from typing import NoReturn


def main() -> None:
    """Load the command line and run it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as `nohup` has it
            signal.signal(number, _end)
    from monochord.cli import main as run  # noqa: PLC0415

    run()


def _end(_number: int, _frame: object) -> NoReturn:
    os.write(2, b"monochord: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    sys.exit(main())
