"""The processor that tests compile kernels for: what all x86-64 processors with AVX2 have in common.

The last bits of the twin's sound depend on it, and a second later so does the line that a driver holds: a
test would pass on one machine and fail on another. ``python -m tests.processor`` compiles them in advance.
"""

import os
import platform

HASWELL = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""}
COMPILED_FOR = HASWELL if platform.machine() == "x86_64" else {}
os.environ.update(COMPILED_FOR)  # before numba is imported, and for every process that a test starts

if __name__ == "__main__":
    from monochord.cli._compile import compile_kernels

    compile_kernels()
