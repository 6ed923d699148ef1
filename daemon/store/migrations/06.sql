CREATE TABLE browser_sessions ( -- of a key: the cookie's token is stored as SHA-256
    hash TEXT PRIMARY KEY,
    key_id TEXT NOT NULL REFERENCES access_keys (id),
    role TEXT NOT NULL,
    created_at TEXT NOT NULL,
    expires_at TEXT NOT NULL,
    touched_at TEXT NOT NULL,
    peer TEXT NOT NULL,
    paired INTEGER NOT NULL
);
ALTER TABLE runs ADD COLUMN started_by TEXT NOT NULL DEFAULT '';
ALTER TABLE runs ADD COLUMN started_by_role TEXT NOT NULL DEFAULT '';
