CREATE TABLE runs (
    id TEXT PRIMARY KEY,
    kind TEXT NOT NULL,
    state TEXT NOT NULL,
    station INTEGER NOT NULL,
    stations INTEGER NOT NULL,
    code TEXT, cause TEXT, fix TEXT,
    created_at TEXT NOT NULL,
    updated_at TEXT NOT NULL,
    request TEXT NOT NULL,
    result TEXT
);
CREATE INDEX runs_by_time ON runs (created_at, id);
CREATE TABLE calibrations (
    id TEXT PRIMARY KEY,
    run_id TEXT,
    created_at TEXT NOT NULL,
    accepted INTEGER NOT NULL,
    document TEXT NOT NULL
);
CREATE TABLE applied (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    calibration_id TEXT NOT NULL REFERENCES calibrations (id),
    applied_at TEXT NOT NULL,
    applied_by TEXT NOT NULL
);
CREATE TABLE scans (
    id TEXT PRIMARY KEY,
    created_at TEXT NOT NULL,
    name TEXT NOT NULL
);
CREATE TABLE scan_views (
    scan_id TEXT NOT NULL REFERENCES scans (id),
    view INTEGER NOT NULL,
    file TEXT NOT NULL,
    unit TEXT NOT NULL,
    base_T_flange TEXT NOT NULL,
    created_at TEXT NOT NULL,
    PRIMARY KEY (scan_id, view)
);
