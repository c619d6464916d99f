"""The benchmark: accuracy and speed, measured on this machine."""

from handcal.lab.bench.run import PARTS, bench_table, run_bench
from handcal.lab.bench.settings import QUICK, BenchSettings

__all__ = ["PARTS", "QUICK", "BenchSettings", "bench_table", "run_bench"]
