"""The command line: its commands, assembled in `main`. Heavy packages are imported inside the commands."""

import os

# Set before numpy is loaded. Its matrices are small here, and on a busy PC its threads wait for each other: a
# calibration takes up to four times as long. Clouds do not use numpy's linear algebra.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # looking for them reads the metadata of all packages
