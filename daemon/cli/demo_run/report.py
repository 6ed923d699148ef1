"""The demo's report: result beside truth, the merged cloud's file, and three curl commands."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from calibration.documents.calibration_text import accuracy_text
from calibration.documents.numbers import significant
from daemon.cli.demo_run.scenario import DemoResult
from handeyed.client import DEFAULT_URL


def report(found: DemoResult) -> str:
    """A table of the result beside the truth."""
    x, truth = found.calibration.flange_T_camera, found.truth["flange_T_camera"]
    assert x is not None  # an accepted eye-in-hand calibration has one
    off, cloud = found.score["calibration"], found.score["cloud"]
    rows = (
        ("", "found", "truth", "off by"),
        (
            "camera on the flange",
            _vector(x.translation_mm),
            _vector(truth["translation_mm"]),
            f"{off['translation_mm']:.3f} mm, {off['rotation_deg']:.4f} deg",
        ),
        (
            "a measured point",
            f"± {significant(found.calibration.accuracy.expanded_mm)} mm (U, k = 2)",
            "",
            f"{off['point_rms_mm']:.2f} mm RMS",
        ),
        (
            "the door's surface",
            f"{cloud['points']:,} points",
            f"{cloud['covered']:.0%} of it covered",
            f"{cloud['rms_mm']:.2f} mm RMS",
        ),
    )
    table = "\n".join(f"  {name:<22}{a:<29}{b:<29}{c}".rstrip() for name, a, b, c in rows)
    return (
        f"\nThe daemon's result beside the truth, which it does not have:\n\n{table}\n\n"
        f"{accuracy_text(found.calibration.accuracy)}\n"
        f"The merged cloud: {found.cloud_file} (base frame, mm; any viewer opens it)"
    )


def report_json(found: DemoResult) -> str:
    """The same as JSON: calibration, truth, score and files."""
    return json.dumps(
        {
            "calibration": found.calibration.model_dump(mode="json"),
            "truth": found.truth,
            "score": found.score,
            "files": {"calibration": str(found.calibration_file), "cloud": str(found.cloud_file)},
        }
    )


def curl_lines(url: str, view: Path) -> str:
    """Three curl commands for a daemon at `url`."""
    ply = f"-H 'Content-Type: application/x-ply' --data-binary @{view}"
    return "\n".join(
        [
            f"  curl {ply} -o in_base.ply '{url}/register?pose=now'",
            f"  curl -X POST -H 'Accept: text/plain' '{url}/calibrate?wait=60'",
            f"  curl -o frame.png {url}/camera/frame.png",
        ]
    )


def next_steps(kept_url: str | None, view: Path) -> str:
    """The demo's last lines: how to keep the cell, and three commands to try."""
    first = (
        f"The cell keeps running until Ctrl-C. Its page: {kept_url}/page/\n"
        if kept_url
        else "`handeyed demo --keep` keeps the cell running."
    )
    return f"\n{first} In another terminal, in this folder:\n\n{curl_lines(kept_url or DEFAULT_URL, view)}\n"


def _vector(values: Iterable[Any]) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in values) + ") mm"
