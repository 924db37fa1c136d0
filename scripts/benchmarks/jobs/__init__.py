"""Run time against error, beside the programs a user would otherwise take: ``python scripts/benchmarks/benchmark.py``.

One module a study (`sweep_study`, `mechanism_study`, ...), one a peer (`peers`), `timing` and `record` for measuring
and keeping rows, `pictures` and `page` for what people read.
"""
