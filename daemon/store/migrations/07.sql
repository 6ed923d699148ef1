ALTER TABLE applied ADD COLUMN role TEXT NOT NULL DEFAULT '';
ALTER TABLE applied ADD COLUMN despite_verdict INTEGER NOT NULL DEFAULT 0;
ALTER TABLE applied ADD COLUMN reason TEXT NOT NULL DEFAULT '';
CREATE TABLE acceptances ( -- of the scanner, each from a scan of an artefact
    id TEXT PRIMARY KEY,
    scan_id TEXT NOT NULL,
    created_at TEXT NOT NULL,
    created_by TEXT NOT NULL,
    document TEXT NOT NULL
);
