"""What the README's figures are measured with."""

import os

# As the command `handeyed` does it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
