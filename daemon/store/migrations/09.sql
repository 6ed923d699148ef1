CREATE TABLE touch_tests ( -- of a calibration, each with the touches it was made from
    id TEXT PRIMARY KEY,
    calibration_id TEXT NOT NULL,
    created_at TEXT NOT NULL,
    created_by TEXT NOT NULL,
    document TEXT NOT NULL
);
