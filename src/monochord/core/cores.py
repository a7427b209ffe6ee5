"""The number of processor cores that this process may use.

A container or a batch system may grant less than the machine has: through the process's affinity, or through
a quota of processor time of its control groups (``cpu.max`` in version 2, ``cpu.cfs_quota_us`` in version 1).
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from math import ceil
from pathlib import Path

GROUPS = Path("/sys/fs/cgroup")
"""Where control groups are mounted."""
PROCESS_GROUPS = Path("/proc/self/cgroup")
"""The control groups of this process."""


def available_cores() -> int:
    """Return the number of cores that this process may use, 1 or more; a quota of 1.5 counts as 2.

    >>> 1 <= available_cores() <= (os.cpu_count() or 1)
    True
    """
    allowed = len(os.sched_getaffinity(0))
    return max(1, min(allowed, ceil(min(_quotas(), default=allowed))))


def _quotas() -> Iterator[float]:
    """Yield the quota, in cores, of each control group of this process that has one, and of their parents."""
    with suppress(OSError):
        for line in PROCESS_GROUPS.read_text(encoding="utf-8").splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers and "cpu" not in controllers.split(","):
                continue
            mount = GROUPS / controllers
            current = mount / path.lstrip("/")
            for group in (current, *current.parents):
                if not group.is_relative_to(mount):
                    break
                with suppress(OSError, ValueError, ZeroDivisionError):
                    quota, period = _times(group, second_version=not controllers)
                    if quota > 0.0:
                        yield quota / period


def _times(group: Path, *, second_version: bool) -> tuple[float, float]:
    """Return the processor time that a group may use in each period, and the period; none or below 0: any."""
    if second_version:
        quota, period = (group / "cpu.max").read_text(encoding="utf-8").split()
        return (-1.0 if quota == "max" else float(quota)), float(period)
    names = "cpu.cfs_quota_us", "cpu.cfs_period_us"
    quota, period = (float((group / name).read_text(encoding="utf-8")) for name in names)
    return quota, period
