CREATE TABLE requests ( -- POSTs with an Idempotency-Key, what they did, and how they were answered
    caller TEXT NOT NULL,
    key TEXT NOT NULL,
    head TEXT NOT NULL,
    body TEXT,
    received_at TEXT NOT NULL,
    effect TEXT,
    status INTEGER, headers TEXT, content BLOB,
    PRIMARY KEY (caller, key)
);
CREATE TABLE events (
    number INTEGER PRIMARY KEY,
    kind TEXT NOT NULL,
    data TEXT NOT NULL
);
CREATE TABLE outbox ( -- what webhooks are told, written with the change itself
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL DEFAULT (lower(hex(randomblob(16)))),
    topic TEXT NOT NULL,
    at TEXT NOT NULL,
    data TEXT NOT NULL
);
CREATE TABLE webhooks (
    name TEXT PRIMARY KEY,
    delivered INTEGER NOT NULL
);
CREATE TRIGGER run_changed AFTER UPDATE OF state ON runs
WHEN NEW.state IN ('finished', 'failed', 'aborted') AND OLD.state <> NEW.state BEGIN
    INSERT INTO outbox (topic, at, data) VALUES ('run.ended', NEW.updated_at, json_object(
        'run_id', NEW.id, 'kind', NEW.kind, 'state', NEW.state, 'code', NEW.code, 'cause', NEW.cause,
        'fix', NEW.fix));
END;
CREATE TRIGGER calibration_stored AFTER INSERT ON calibrations BEGIN
    INSERT INTO outbox (topic, at, data) VALUES ('calibration.stored', NEW.created_at, json_object(
        'calibration_id', NEW.id, 'run_id', NEW.run_id, 'accepted', json(iif(NEW.accepted, 'true', 'false'))));
END;
CREATE TRIGGER calibration_applied AFTER INSERT ON applied BEGIN
    INSERT INTO outbox (topic, at, data) VALUES ('calibration.applied', NEW.applied_at, json_object(
        'calibration_id', NEW.calibration_id, 'applied_by', NEW.applied_by, 'sequence', NEW.sequence));
END;
CREATE TRIGGER scan_view_stored AFTER INSERT ON scan_views BEGIN
    INSERT INTO outbox (topic, at, data) VALUES ('scan.view', NEW.created_at, json_object(
        'scan_id', NEW.scan_id, 'view', NEW.view));
END;
CREATE TABLE access_keys (
    id TEXT PRIMARY KEY,
    name TEXT NOT NULL,
    role TEXT NOT NULL,
    hash TEXT NOT NULL,
    created_at TEXT NOT NULL,
    expires_at TEXT,
    revoked_at TEXT
);
CREATE TABLE audit (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    at TEXT NOT NULL,
    actor TEXT NOT NULL,
    role TEXT NOT NULL,
    action TEXT NOT NULL,
    subject TEXT NOT NULL,
    detail TEXT NOT NULL,
    hash TEXT NOT NULL
);
CREATE TRIGGER audit_is_not_changed BEFORE UPDATE ON audit BEGIN
    SELECT RAISE(ABORT, 'the audit log is append-only');
END;
CREATE TRIGGER audit_is_not_shortened BEFORE DELETE ON audit BEGIN
    SELECT RAISE(ABORT, 'the audit log is append-only');
END;
