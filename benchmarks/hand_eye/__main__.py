"""`python -m benchmarks.hand_eye`: see `benchmarks.hand_eye.tables`."""

from benchmarks.hand_eye.tables import main

# Spawned workers import functions by their module's name, which `__main__` of a package has not.
if __name__ == "__main__":
    main()
