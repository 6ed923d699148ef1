"""Benchmarks behind the README's figures."""

import os

# As the command `handeyed` does.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
