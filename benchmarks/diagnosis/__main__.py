"""`python -m benchmarks.diagnosis`: see `benchmarks.diagnosis.tables`."""

from benchmarks.diagnosis.tables import main

# Spawned workers import functions by their module's name, which `__main__` of a package has not.
if __name__ == "__main__":
    main()
