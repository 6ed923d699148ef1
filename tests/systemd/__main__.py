"""Run the story: `python3 -m tests.systemd DEB [--suite bookworm]`; exit status 0 when it holds."""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tests.systemd.machine import Failed, Machine, make_root, missing
from tests.systemd.story import STEPS, Story

BUILD = Path(__file__).resolve().parents[2] / "build" / "systemd"


def main() -> int:
    """Run the steps in order; what went wrong is printed, and the machine's last log lines with it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("deb", type=Path)
    parser.add_argument("--suite", default="bookworm", help="the Debian that is booted")
    parser.add_argument("--mirror", help="of Debian's packages")
    parser.add_argument("--until", default="", help="stop before this step, and leave the machine up until Enter")
    parser.add_argument("--verbose", action="store_true", help="print what each command of the runbook prints")
    arguments = parser.parse_args()
    if lacking := missing():
        print("the package cannot be tried under systemd here: " + "; ".join(lacking))
        return 2
    began_s = time.monotonic()
    archive = BUILD / f"{arguments.suite}.tar"
    make_root(arguments.suite, archive, arguments.mirror)
    with tempfile.TemporaryDirectory(prefix="handeyed-systemd-") as folder:
        machine = Machine(archive, Path(folder))
        done = 0
        try:
            machine.boot()
            say(began_s, f"Debian {arguments.suite} is up, with a live systemd")
            story = Story(machine, arguments.deb.resolve(), Path(folder), arguments.verbose)
            for step in STEPS:
                if step.__name__ == arguments.until:
                    input(f"before {step.__name__}: Enter goes on ")
                began_step_s = time.monotonic()
                step(story)
                done += 1
                say(began_step_s, f"{step.__name__.replace('_', ' ')}: {step.__doc__}")
        except Failed as error:
            print(f"FAILED  {STEPS[done].__name__}\n{error}")
            print(machine.run("journalctl --unit=handeyed --no-pager --lines=30", check=False).text)
            print(f"{done} passed, 1 failed")
            return 1
        finally:
            machine.close()
    print(f"{len(STEPS)} passed, 0 failed")
    return 0


def say(began_s: float, what: str) -> None:
    """Print what held, and how long it took."""
    print(f"ok  {time.monotonic() - began_s:5.1f} s  {what}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
