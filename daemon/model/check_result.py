"""What a check has found: of `handeyed check`, and of POST /check."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CheckResult:
    """One thing that was looked at: `what` was found, and what to do when it is not well."""

    name: str
    ok: bool
    what: str
    fix: str = ""

    def line(self) -> str:
        """ok    robot     what"""
        return f"{'ok' if self.ok else 'FAIL':<6}{self.name:<10}{self.what}" + (f": {self.fix}" if self.fix else "")
