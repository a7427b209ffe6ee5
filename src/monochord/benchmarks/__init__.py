"""Benchmarks: one file a benchmark, found by its name; each compares with a baseline of the same run."""

from monochord.benchmarks.base import Benchmark
from monochord.core.registry import Registry

BENCHMARKS: Registry[Benchmark] = Registry("monochord.benchmarks", Benchmark)

__all__ = ["BENCHMARKS"]
