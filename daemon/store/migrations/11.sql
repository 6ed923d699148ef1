CREATE TABLE rigs ( -- several sensors on one mount: rig.json; the last row is in force
    id TEXT PRIMARY KEY,
    setup TEXT NOT NULL,
    created_at TEXT NOT NULL,
    created_by TEXT NOT NULL,
    document TEXT NOT NULL
);
