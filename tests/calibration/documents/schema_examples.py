"""Examples of the documents, which the tests run: `handeyed solve`, `register` and `plan` take them as they are."""

from typing import Any


def _pose(x: float, y: float, z: float, *wxyz: float) -> dict[str, Any]:
    return {"translation_mm": [x, y, z], "quaternion_wxyz": list(wxyz)}


TARGET: dict[str, Any] = {
    "kind": "charuco", "columns": 7, "rows": 5, "square_mm": 30.0, "marker_mm": 22.0, "dictionary": "DICT_5X5_100",
}  # fmt: skip

PAIRS = (
    ((991.014, 143.943, 691.209, 0.1683564, 0.6850443, 0.7086827, -0.0117969),
     (-97.071, -81.689, 496.311, 0.9875267, 0.1493432, 5.4e-06, 0.0498754)),
    ((1168.168, -153.97, 676.541, 0.1313856, -0.426225, -0.8846109, -0.1361381),
     (-18.99, -121.797, 558.179, 0.9089436, -0.1454391, 0.0485031, 0.3877067)),
    ((1194.69, -28.525, 684.555, 0.0226921, 0.921536, 0.3749191, -0.0984486),
     (-122.831, 7.066, 558.572, 0.9231608, 0.0487318, 0.1705215, -0.3410597)),
    ((967.816, -113.705, 704.383, 0.026087, -0.130392, 0.9767292, 0.1682779),
     (105.762, -73.854, 520.172, 0.5720907, -4.93e-05, -0.1279331, 0.8101514)),
    ((1159.953, 22.47, 693.191, 0.1319519, 0.9840135, -0.0084911, -0.1193063),
     (-80.726, 95.37, 552.336, 0.7175283, 0.1131075, 0.1129769, -0.6779351)),
    ((929.483, -177.288, 686.765, 0.0249501, 0.6183774, 0.7535103, 0.2218311),
     (-77.833, -102.87, 519.543, 0.9788355, -0.0993158, -0.099273, 0.1488699)),
)  # fmt: skip
"""base_T_flange and camera_T_target of six views."""

SESSION: dict[str, Any] = {
    "schema_version": 1,
    "source": "a tracker's poses, for the example",
    "setup": "eye-in-hand",
    "views": [{"base_T_flange": _pose(*robot), "camera_T_target": _pose(*seen)} for robot, seen in PAIRS],
}

SCAN: dict[str, Any] = {
    "schema_version": 1,
    "source": "two clouds, for the example",
    "setup": "eye-in-hand",
    "views": [
        {"cloud": "view_000.ply", "unit": "m", "base_T_flange": _pose(812.4, -35.1, 640.0, 0.0, 1.0, 0.0, 0.0)},
        {"cloud": "view_001.ply", "unit": "m", "base_T_flange": _pose(852.4, -35.1, 640.0, 0.0, 0.8, 0.6, 0.0)},
    ],
}

PROFILES: dict[str, Any] = {
    "schema_version": 1,
    "source": "a sweep over a sphere and one over a plane, for the example",
    "time_unit": "s",
    "artefacts": [{"name": "sphere", "radius_mm": 25.0}, {"name": "table", "radius_mm": None}],
    "sweeps": [
        {"profiles": "sweep_000.npz", "path": "path_000.csv", "artefact": "sphere"},
        {"profiles": "sweep_001.npz", "path": "path_001.csv", "artefact": "table"},
    ],
}

POINTS: dict[str, Any] = {
    "schema_version": 1,
    "box_mm": [[800.0, -200.0, 0.0], [1200.0, 200.0, 150.0]],
    "points": [{"name": "hole 1", "position_mm": [1000.0, 0.0, 120.0]}],
}

TIP: dict[str, Any] = {
    "flange_tip_mm": [0.0, 0.0, 180.2],
    "covariance": [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]],
    "placing_sigma_mm": 0.1,
}

TOUCHES: dict[str, Any] = {
    "schema_version": 1,
    "touches": [
        {"id": 0, "base_T_flange": _pose(905.1, 48.2, 279.9, 0.0, 1.0, 0.0, 0.0)},
        {
            "name": "hole 4", "camera_mm": [31.2, -40.5, 512.0], "sigma_mm": 0.05,
            "seen_from": _pose(880.0, 20.5, 690.0, 0.0, 0.98, 0.2, 0.0),
            "base_T_flange": _pose(931.7, 12.9, 276.3, 0.0, 1.0, 0.0, 0.0), "miss_mm": [0.0, 0.0, -0.3],
        },
    ],
}  # fmt: skip

PLAN: dict[str, Any] = {
    "schema_version": 1,
    "target": TARGET,
    "camera": {
        "matrix": [[900.0, 0.0, 319.5], [0.0, 900.0, 239.5], [0.0, 0.0, 1.0]],
        "distortion": [0.0, 0.0, 0.0, 0.0, 0.0],
        "image_size": [640, 480],
    },
    "flange_T_camera_guess": _pose(35.0, -20.0, 90.0, 1.0, 0.0, 0.0, 0.0),
    "base_T_target_guess": _pose(900.0, 50.0, 100.0, 1.0, 0.0, 0.0, 0.0),
    "poses": 4,
}

HASH = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"

MANIFEST: dict[str, Any] = {
    "schema_version": 1,
    "scan": "2026/door",
    "calibration_id": "20261122T101500-3f2a",
    "input_sha256": HASH,
    "points": 612_344,
    "accepted": True,
    "files": [
        {"name": "merged.ply", "bytes": 7_348_312, "sha256": HASH},
        {"name": "report.json", "bytes": 1_920, "sha256": HASH},
    ],
}

OUTCOME: dict[str, Any] = {
    "scan": "2026/door",
    "state": "registered",
    "points": 612_344,
    "accepted": True,
    "error": None,
}

DETECTIONS: dict[str, Any] = {
    "schema_version": 1,
    "views": [
        {
            "index": 0, "at": "2026-11-22T10:15:02.118Z", "configuration": [0, -1, 0, 0],
            "corners": [[0, 211.42, 180.07], [1, 249.88, 180.31]], "missing": None, "sharpness": 0.82,
        },
        {
            "index": 1, "at": "2026-11-22T10:15:09.740Z", "configuration": [0, -1, 0, 0], "corners": [],
            "missing": {"code": "too-few-points", "what": "3 of 24 points found", "id": "as-written", "params": {}},
            "sharpness": None,
        },
    ],
}  # fmt: skip

ACCEPTANCE: dict[str, Any] = {
    "schema_version": 1,
    "handeyed": "0.1.0",
    "began_at": "2026-11-22 10:15:00 UTC",
    "address": "tcp://192.168.125.1:4242",
    "services": "rws://192.168.125.1",
    "controller": {"name": "cell 7", "rwversion": "6.15.02"},
    "accepted": True,
    "counts": {"passed": 1, "failed": 0, "skipped": 0},
    "rows": [
        {
            "code": "timings", "assumption": "each command answers in time", "verdict": "passed", "what": "",
            "measured": {"slowest_ms": 21.4}, "seconds": 3.2,
        },
    ],
    "event_log": [
        {"number": 8121, "kind": 1, "code": 10_010, "at": "2026-11-22 T 10:14:31", "title": "Motors OFF state",
         "description": "The system is in the Motors OFF state."},
    ],
}  # fmt: skip

SETUP: dict[str, Any] = {
    "version": 1,
    "files": {"handeyed/CELL_comm.mod": False, "handeyed/CELL_shared.sys": True},
    "instances": [["SYS", "CAB_TASKS", "T_HANDEYED"]],
    "symbols": {"CELL_shared/cell_reach": "1450"},
    "configuration": ["EIO.cfg", "SYS.cfg"],
}

BACKUP: dict[str, Any] = {
    "made_at": "2026-11-22T10:15:00Z",
    "schema": 12,
    "format": 2,
    "files": {"handeyed.sqlite": HASH, "audit-anchor.json": HASH, "runs/20261122T101500-3f2a/session.json": HASH},
}
