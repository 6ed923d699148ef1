"""Serial lines and files: an iodev on the pty behind a port's name, or on a file of the controller's disk."""

from types import MappingProxyType
from typing import Any

from mock_robot.cabinet.disk import NoVolume
from mock_robot.rapid.devices import OpenFile
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.sockets import DEFAULT_WAIT_S, MAX_WAIT_S
from mock_robot.rapid.operators import ORIENT, POS
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.symbols import text_of
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import BOOL, NUM
from mock_robot.rapid.values import MAX_RAWBYTES, integer, short, single

EOF_BIN, EOF_NUM = -1.0, single(9.998e36)


def open_(
    task: ProgramTask,
    port: str,
    file: str | None,
    slot: Slot,
    read: bool | None,
    write: bool | None,
    append: bool | None,
    binary: bool | None,
) -> None:
    """A channel for both directions needs \\Bin and none of the other switches; a file is written by default."""
    if port.casefold() not in task.services.devices.lines and (file is not None or _is_on_disk(task, port)):
        slot.value.file = _open_file(task, port if file is None else f"{port}/{file}", bool(read), bool(append))
        return
    if not binary or read or write or append:
        raise RapidError("ERR_ARGVALERR", "the mock opens a channel only with \\Bin, for both directions")
    line = task.services.devices.lines.get(port.casefold())
    if line is None:
        raise RapidError("ERR_FILEOPEN", f"no channel is named {port}")
    slot.value.open(line)
    task.services.devices.add(slot.value)


def _path(task: ProgramTask, path: str) -> str:
    try:
        return str(task.services.disk.canonical(path))
    except NoVolume:
        raise RapidError("ERR_FILEACC", f"{path} is on no disk") from None


def _is_on_disk(task: ProgramTask, path: str) -> bool:
    try:
        task.services.disk.canonical(path)
    except NoVolume:
        return False
    return True


def _open_file(task: ProgramTask, name: str, read: bool, append: bool) -> OpenFile:
    path, disk = _path(task, name), task.services.disk
    if read and path not in disk.files:
        raise RapidError("ERR_FILEOPEN", f"there is no file {name}")
    if not read and (not append or path not in disk.files):
        disk.files[path] = b""
    return OpenFile(disk, path, writes=not read)


def is_file(task: ProgramTask, path: str, directory: bool | None) -> bool:
    known = _path(task, path)
    return task.services.disk.has_folder(known) if directory else known in task.services.disk.files


def file_size(task: ProgramTask, path: str) -> float:
    return float(len(_existing(task, path)))


def remove_file(task: ProgramTask, path: str) -> None:
    _existing(task, path)
    del task.services.disk.files[_path(task, path)]


def make_dir(task: ProgramTask, path: str) -> None:
    task.services.disk.folders.add(_path(task, path))


def copy_file(task: ProgramTask, old: str, new: str) -> None:
    if _path(task, new) in task.services.disk.files:
        raise RapidError("ERR_FILEEXIST", f"{new} is there already")
    task.services.disk.files[_path(task, new)] = _existing(task, old)


def rename_file(task: ProgramTask, old: str, new: str) -> None:
    copy_file(task, old, new)
    remove_file(task, old)


def open_dir(task: ProgramTask, folder: Slot, path: str) -> None:
    known, disk = _path(task, path), task.services.disk
    if not disk.has_folder(known):
        raise RapidError("ERR_FILEACC", f"there is no folder {path}")
    below = (
        each[len(known) + 1 :].split("/")[0] for each in (*disk.files, *disk.folders) if each.startswith(known + "/")
    )
    folder.value.names = [".", "..", *sorted(set(below))]


def read_dir(task: ProgramTask, folder: Slot, name: Slot) -> bool:
    """The next name; FALSE behind the last one."""
    if folder.value.names is None:
        raise RapidError("ERR_FILEACC", "OpenDir comes first")
    if not folder.value.names:
        return False
    name.value = short(folder.value.names.pop(0))
    return True


def close_dir(task: ProgramTask, folder: Slot) -> None:
    folder.value.names = None


def _existing(task: ProgramTask, path: str) -> bytes:
    content = task.services.disk.files.get(_path(task, path))
    if content is None:
        raise RapidError("ERR_FILEACC", f"there is no file {path}")
    return bytes(content)


def write_text(
    task: ProgramTask,
    slot: Slot,
    text: str,
    num: float | None,
    truth: bool | None,
    pos: list[float] | None,
    orient: list[float] | None,
    dnum: float | None,
    same_line: bool | None,
) -> None:
    """The text, the value behind it, and the end of the line."""
    shown = "".join(
        text_of(kind, value)
        for kind, value in ((NUM, num), (BOOL, truth), (POS, pos), (ORIENT, orient), (NUM, dnum))
        if value is not None
    )
    slot.value.send(f"{text}{shown}{'' if same_line else chr(10)}".encode("latin-1"), task.services.wire)


def write_str_bin(task: ProgramTask, slot: Slot, text: str) -> None:
    slot.value.send(text.encode("latin-1"), task.services.wire)


def _file(slot: Slot) -> OpenFile:
    file: OpenFile | None = slot.value.file
    if file is None:
        raise RapidError("ERR_FILEACC", "the file is not open")
    return file


def read_str(task: ProgramTask, slot: Slot) -> str:
    """A line without its end; EOF behind the last one."""
    file = _file(slot)
    line, end, _ = file.content[file.place :].partition(b"\n")
    if not line and not end:
        return "EOF"
    return short(file.read(len(line) + len(end)).decode("latin-1").rstrip("\r\n"))


def read_num(task: ProgramTask, slot: Slot) -> float:
    """The number on the next line; EOF_NUM behind the last one."""
    text = read_str(task, slot)
    try:
        return EOF_NUM if text == "EOF" else single(float(text))
    except ValueError:
        raise RapidError("ERR_RCVDATA", f"{text!r} is no number") from None


def read_raw_bytes(task: ProgramTask, slot: Slot, raw: Slot, time: float | None) -> None:
    """As many bytes as fit."""
    data = _file(slot).read(MAX_RAWBYTES)
    if not data:
        raise RapidError("ERR_RANYBIN_EOF", "the end of the file")
    raw.value.fill(data)


def rewind(task: ProgramTask, slot: Slot) -> None:
    _file(slot).place = 0


def close(task: ProgramTask, slot: Slot) -> None:
    slot.value.close()
    task.services.devices.drop(slot.value)


def clear_buffer(task: ProgramTask, slot: Slot) -> None:
    """Drop what a line has received."""
    slot.value.line.look(task.services.wire)
    slot.value.line.arrived.clear()


def read_bin(task: ProgramTask, slot: Slot, time: float | None) -> float:
    """Read one byte; EOF_BIN at the end of a file."""
    if slot.value.file is not None:
        taken = slot.value.file.read(1)
        return float(taken[0]) if taken else EOF_BIN
    line, seconds = slot.value.line, DEFAULT_WAIT_S if time is None else time
    task.services.devices.note_listening()
    ends_s = None if seconds >= MAX_WAIT_S else task.now_s() + seconds
    while not line.arrived and not line.look(task.services.wire):
        left_s = None if ends_s is None else max(0.0, ends_s - task.now_s())
        if not task.wait(left_s, line.fileno):
            raise RapidError("ERR_DEV_MAXTIME", "no byte came")
    return float(line.arrived.pop(0))


def write_raw_bytes(task: ProgramTask, slot: Slot, raw: Any, count: float | None) -> None:
    data = raw.value.valid() if count is None else raw.value.read(1, integer(count))
    slot.value.send(data, task.services.wire)


DOES = MappingProxyType(
    {
        "Open": open_,
        "Close": close,
        "ClearIOBuff": clear_buffer,
        "ReadBin": read_bin,
        "WriteRawBytes": write_raw_bytes,
        "ReadRawBytes": read_raw_bytes,
        "ReadStr": read_str,
        "ReadNum": read_num,
        "Rewind": rewind,
        "Write": write_text,
        "WriteStrBin": write_str_bin,
        "IsFile": is_file,
        "FileSize": file_size,
        "RemoveFile": remove_file,
        "MakeDir": make_dir,
        "CopyFile": copy_file,
        "RenameFile": rename_file,
        "OpenDir": open_dir,
        "ReadDir": read_dir,
        "CloseDir": close_dir,
    }
)
