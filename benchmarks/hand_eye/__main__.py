"""`python -m benchmarks.hand_eye`: see `benchmarks.hand_eye.tables`."""

from benchmarks.hand_eye.tables import main

# spawned workers import functions by their module's name, which a package's `__main__` does not have
if __name__ == "__main__":
    main()
