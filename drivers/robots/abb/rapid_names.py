"""Names in the RAPID modules and fragments: task, link task, mechanical unit, port, prefix; one set for each arm.

The shipped files in deploy/rapid have the names of a controller with one arm. For another one (T_ROB_L and T_ROB_R of a
YuMi, T_ROB2 of a MultiMove system) the same text is written with other names; the prefix keeps two sets apart.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class RapidNames:
    """Names of one arm's program. `prefix`: what every name of data, routines, modules and signals begins with."""

    motion_task: str = "T_ROB1"
    link_task: str = "T_HANDEYED"
    mechanical_unit: str = "ROB_1"
    port: int = 4242
    prefix: str = "cell"

    def rename(self, text: str) -> str:
        """The text of a shipped module or fragment with these names."""
        shipped = RapidNames()
        words = {
            shipped.motion_task: self.motion_task,
            shipped.link_task: self.link_task,
            shipped.mechanical_unit: self.mechanical_unit,
        }
        text = re.sub(rf"\b({'|'.join(words)})\b", lambda found: words[found[0]], text)
        text = re.sub(r"\bcell_", f"{self.prefix}_", text)
        text = re.sub(r"\bCELL_", f"{self.prefix.upper()}_", text)
        if self.prefix != shipped.prefix:
            text = re.sub(r"\bCB_(?=[A-Z])", f"{self.prefix.upper()}_CB_", text)
        return re.sub(rf"(_port := ){shipped.port};", rf"\g<1>{self.port};", text)

    def rename_all(self, files: Mapping[str, str]) -> dict[str, str]:
        """Files by name with these names, in the texts and in the names of the files."""
        return {self.rename(name): self.rename(text) for name, text in files.items()}
