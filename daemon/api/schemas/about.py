"""Schemas of GET /settings, /about and /help."""

from typing import Any, Literal

from daemon.api.schemas.answer import Answer


class SettingsDocument(Answer):
    """The settings as loaded, with every default, and those that the file gives. Secrets are "[removed]"."""

    settings: dict[str, Any]
    given: dict[str, Any]


class PackageDocument(Answer):
    """An installed package."""

    name: str
    version: str
    licence: str


class SettingsFileDocument(Answer):
    """The settings file that the daemon loaded when it started, and the SHA-256 of what it held then."""

    file: str
    sha256: str


class AboutDocument(Answer):
    """The software and what it uses. `settings`: null for a daemon that was not started from a file."""

    software: str
    licence: str
    python: str
    packages: list[PackageDocument]
    settings: SettingsFileDocument | None


class HelpDocument(Answer):
    """What a code means. `kind`: of an error's `code`, a finding's `id`, or an advice's `id`. `status`: of an error.

    `what` of a finding or an advice is its sentence, with places {name} for its parameters.
    """

    code: str
    kind: Literal["error", "finding", "advice"]
    what: str
    status: int | None = None


class HelpList(Answer):
    """Every code, sorted."""

    help: list[HelpDocument]
