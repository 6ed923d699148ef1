"""The RAPID modules and configuration fragments that are copied to a controller."""

from pathlib import Path

from daemon.cli.errors import UnreadableInput

SUFFIXES = (".mod", ".sys", ".cfg")
_ROOT = Path(__file__).parents[2]
PLACES = (_ROOT / "deploy" / "rapid", _ROOT / "mock_robot" / "rapid" / "modules")
"""In the repository, and as the wheel holds them."""


def module_folder(given: Path | None) -> Path:
    """The folder given, or that of this release's modules. Raises CommandError without any."""
    found = given or next((place for place in PLACES if (place / "CELL_shared.sys").exists()), None)
    if found is None:
        raise UnreadableInput("the modules", "they are not installed here", "give --modules deploy/rapid")
    return found


def module_files(folder: Path, *, modules: bool = True) -> dict[str, bytes]:
    """Files of a folder that a controller loads, by name. Raises CommandError when `modules` are wanted and absent."""
    from daemon.runtime.bounded_read import read_bounded

    if not (modules or folder.is_dir()):
        return {}
    try:
        found = {path.name: read_bounded(path) for path in sorted(folder.iterdir()) if path.suffix in SUFFIXES}
    except OSError as error:
        raise UnreadableInput(str(folder), error.strerror or str(error), "name the folder of the modules") from None
    if modules and not any(name.endswith((".mod", ".sys")) for name in found):
        raise UnreadableInput(str(folder), "no RAPID module is in it", "name deploy/rapid")
    return found


EGM_HOST = b"192.168.125.99"
"""The PC's address in the fragments for EGM, as delivered."""


def program_files(folder: Path, robotware: int, *, called: bool, egm: str | None) -> dict[str, bytes]:
    """Modules and fragments that an installation loads, by name.

    `called`: a main of the customer's calls the motion part, so that there is no CELL_main; `egm`: this PC's address
    for position streams, None without them. Raises CommandError.
    """
    fragments = folder / f"rw{robotware}"
    files = module_files(folder) | module_files(fragments, modules=False)
    if called:
        files |= module_files(fragments / "called", modules=False)
        files.pop("CELL_main.mod", None)
    if egm is None:
        files.pop("CELL_egm.mod", None)
        return files
    for name, content in module_files(fragments / "egm", modules=False).items():
        files[name.replace(".cfg", "_egm.cfg")] = content.replace(EGM_HOST, egm.encode("ascii", "replace"))
    return files
