"""Connections that ask nothing: PORT COUNT SECONDS; with a fourth word each comes back as it is closed."""

import asyncio
import resource
import sys
import time


async def connect(port: int, end: float, *, again: bool) -> int:
    """Connect, ask nothing, and return how often."""
    count = 0
    while (left := end - time.monotonic()) > 0.0:
        try:
            async with asyncio.timeout(left):
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                count += 1
                try:
                    await reader.read()
                finally:
                    writer.close()
        except OSError:  # refused, reset, or time is up
            pass
        if count and not again:
            break
    return count


async def main(port: int, count: int, seconds: float, *, again: bool) -> None:
    """Have so many connections for so long."""
    end = time.monotonic() + seconds
    counts = await asyncio.gather(*(connect(port, end, again=again) for _ in range(count)))
    sys.stdout.write(f"{sum(counts)}\n")


if __name__ == "__main__":
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit))
    port_, count_, seconds_, *again_ = sys.argv[1:]
    asyncio.run(main(int(port_), int(count_), float(seconds_), again=bool(again_)))
