"""`python -m benchmarks.diagnosis`: see `benchmarks.diagnosis.tables`."""

from benchmarks.diagnosis.tables import main

# spawned workers import functions by their module's name, which a package's `__main__` does not have
if __name__ == "__main__":
    main()
