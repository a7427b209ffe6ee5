"""Benchmarks to run on your machine: one module per benchmark, found by name."""

from monochord.benchmarks._process import one_core, resident
from monochord.benchmarks.base import Benchmark
from monochord.core.registry import Registry

BENCHMARKS: Registry[Benchmark] = Registry("monochord.benchmarks", Benchmark)

__all__ = ["BENCHMARKS", "one_core", "resident"]
