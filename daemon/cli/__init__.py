"""The command line: one module a command, assembled in `main`. Heavy rooms are imported inside the commands."""

import os

# Before numpy is loaded: its matrices are small here, and on a busy PC threads that share one out wait for each other
# (a calibration takes up to four times as long). Clouds are not worked on by numpy's linear algebra.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
