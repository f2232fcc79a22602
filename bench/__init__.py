"""Benchmarks: speed and memory, each number beside a baseline measured in the same run. ``make bench``."""
