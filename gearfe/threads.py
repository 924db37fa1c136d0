"""One thread for dense linear algebra on small matrices.

The fronts of a tooth sector have a few hundred unknowns: there, the threads of a BLAS library wait for one another more
than they work (measured on two busy cores: 25 times slower than one thread).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold the BLAS libraries of this process at one thread, and give them back their number afterwards."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield
