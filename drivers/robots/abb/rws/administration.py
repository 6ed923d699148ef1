"""What an installation changes over Robot Web Services: files, configuration, RAPID symbols."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from urllib.parse import quote, urlsplit

from drivers.errors import DeviceTimeout, RequestRefused
from drivers.robots.abb.rws.controller_reader import ABSENT, ConfigurationInstance, ControllerReader

BACKUP_LIMIT_S, BACKUP_POLL_S = 300, 1
BACKUP_FIX = "make one at the pendant, look at the event log, then run this again"


class RwsAdministration(ControllerReader):
    """One session that also changes what is on the controller. Every method raises DeviceError."""

    async def make_folder(self, path: str) -> None:
        """Make a folder below HOME, and those above it."""
        parent = self._dialect.home
        for name in path.strip("/").split("/"):
            try:
                await self.client.ask("GET", f"/fileservice/{parent}/{name}", headers=self._dialect.file_headers)
            except RequestRefused as refused:
                if refused.status != "NOT_FOUND":
                    raise
                action, form = self._dialect.call("make_folder", parent=parent, name=name)
                await self.client.post(action, {}, form)
            parent = f"{parent}/{name}"

    async def write_file(self, path: str, content: bytes) -> None:
        """Write a file below HOME; its folder must exist."""
        place, headers = f"/fileservice/{self._dialect.home}/{path}", self._dialect.file_headers
        await self.client.ask("PUT", place, content=content, headers=headers)

    async def delete_file(self, path: str) -> None:
        """Delete a file or an empty folder below HOME; no effect when there is none."""
        place, headers = f"/fileservice/{self._dialect.home}/{path}", self._dialect.file_headers
        try:
            await self.client.ask("DELETE", place, headers=headers)
        except RequestRefused as refused:
            if refused.status not in ABSENT:
                raise

    async def save_backup(self, name: str) -> None:
        """Make a full backup of that name on the controller, and wait for it. Its disk holds it, not HOME."""
        dialect = self._dialect
        answer = await self.client.post(*dialect.call("backup"), {"backup": f"/fileservice/{dialect.backups}/{name}"})
        progress = urlsplit(answer.headers.get("location", "")).path
        for _ in range(int(BACKUP_LIMIT_S / BACKUP_POLL_S)):
            values = await self.read_first(progress) if progress else {}
            if values.get("state") == "ready":
                code = str(values.get("code") or "0")
                if code.isdecimal() and int(code) < 1 << 31:
                    return
                # An HRESULT: an error is negative, or above 2**31 where it is written without a sign.
                raise RequestRefused(self.device, f"the backup {name} failed ({code})", BACKUP_FIX)
            await self._timing.sleep(BACKUP_POLL_S)
        raise DeviceTimeout(self.device, f"the backup {name} was not ready in {BACKUP_LIMIT_S} s", BACKUP_FIX)

    async def save_configuration(self, domain: str, path: str) -> bytes | None:
        """Save a domain to a file below HOME, and return its content."""
        form = {"filepath": f"/fileservice/{self._dialect.home}/{path}"}
        await self.client.post(*self._dialect.call("save_cfg", domain=domain), form)
        return await self.read_file(path)

    @asynccontextmanager
    async def hold_mastership(self, domain: str) -> AsyncIterator[None]:
        """Hold the mastership of `cfg` or `rapid` meanwhile."""
        await self.client.post(*self._dialect.call("mastership", domain=domain, action="request"), {})
        try:
            yield
        finally:
            await self.client.post(*self._dialect.call("mastership", domain=domain, action="release"), {})

    async def load_configuration(self, path: str) -> None:
        """Load a configuration file of HOME, when it has no duplicates. Needs the mastership of cfg."""
        form = {"filepath": f"{self._dialect.home}/{path}", "action-type": "add"}
        await self.client.post(*self._dialect.call("load_cfg"), form)

    async def delete_instance(self, domain: str, kind: str, found: ConfigurationInstance) -> None:
        """Delete an instance of the configuration, by its id where it has no title. Needs the mastership of cfg."""
        handle = quote(found.title or found.instance_id, safe="")
        await self.client.delete(f"/rw/cfg/{domain}/{kind}/instances/{handle}")

    async def write_symbol(self, name: str, value: str) -> None:
        """Set a PERS. Needs the mastership of rapid."""
        await self.client.post(*self._dialect.call("set_symbol", name=name), {"value": value})
