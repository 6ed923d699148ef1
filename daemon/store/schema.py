"""The database schema. Migrations are forward only: append one, never change one that was released."""

MIGRATIONS: tuple[str, ...] = (
    """
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
    """,
    """
    ALTER TABLE runs ADD COLUMN planning TEXT;
    """,
    """
    ALTER TABLE scans ADD COLUMN refine INTEGER NOT NULL DEFAULT 0;
    """,
    """
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
    """,
    """
    -- calibrations.document holds calibration.json 2 from here on, which older daemons cannot read; 1 stays as it is.
    """,
    """
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
    """,
    """
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
    """,
    """
    CREATE TABLE arms ( -- the arm's errors identified with a calibration: arm.json
        calibration_id TEXT PRIMARY KEY REFERENCES calibrations (id),
        document TEXT NOT NULL
    );
    """,
    """
    CREATE TABLE touch_tests ( -- of a calibration, each with the touches it was made from
        id TEXT PRIMARY KEY,
        calibration_id TEXT NOT NULL,
        created_at TEXT NOT NULL,
        created_by TEXT NOT NULL,
        document TEXT NOT NULL
    );
    """,
    """
    ALTER TABLE scan_views ADD COLUMN joints_deg TEXT; -- null where the pose came without
    """,
    """
    CREATE TABLE rigs ( -- several sensors on one mount: rig.json; the last row is in force
        id TEXT PRIMARY KEY,
        setup TEXT NOT NULL,
        created_at TEXT NOT NULL,
        created_by TEXT NOT NULL,
        document TEXT NOT NULL
    );
    """,
    """
    ALTER TABLE calibrations ADD COLUMN camera TEXT NOT NULL DEFAULT 'camera'; -- by its name in the settings
    ALTER TABLE applied ADD COLUMN camera TEXT NOT NULL DEFAULT 'camera';
    ALTER TABLE scans ADD COLUMN scanner TEXT NOT NULL DEFAULT 'scanner';
    DROP TRIGGER calibration_stored;
    DROP TRIGGER calibration_applied;
    CREATE TRIGGER calibration_stored AFTER INSERT ON calibrations BEGIN
        INSERT INTO outbox (topic, at, data) VALUES ('calibration.stored', NEW.created_at, json_object(
            'calibration_id', NEW.id, 'run_id', NEW.run_id, 'accepted', json(iif(NEW.accepted, 'true', 'false')),
            'camera', NEW.camera));
    END;
    CREATE TRIGGER calibration_applied AFTER INSERT ON applied BEGIN
        INSERT INTO outbox (topic, at, data) VALUES ('calibration.applied', NEW.applied_at, json_object(
            'calibration_id', NEW.calibration_id, 'applied_by', NEW.applied_by, 'sequence', NEW.sequence,
            'camera', NEW.camera));
    END;
    """,
    """
    ALTER TABLE scan_views ADD COLUMN external_axes TEXT; -- null where the controller has none
    """,
    """
    ALTER TABLE scan_views ADD COLUMN points INTEGER; -- null in views from before this was stored, as bytes
    ALTER TABLE scan_views ADD COLUMN bytes INTEGER;
    ALTER TABLE scan_views ADD COLUMN created_by TEXT NOT NULL DEFAULT '';
    """,
    """
    DELETE FROM browser_sessions WHERE paired; -- of which it is not known with whose end they should end
    ALTER TABLE browser_sessions ADD COLUMN parent TEXT REFERENCES browser_sessions (hash) ON DELETE CASCADE;
    """,
    """
    DROP TRIGGER run_changed;
    DROP TRIGGER calibration_stored;
    DROP TRIGGER calibration_applied;
    CREATE TRIGGER run_changed AFTER UPDATE OF state ON runs
    WHEN NEW.state IN ('finished', 'failed', 'aborted') AND OLD.state <> NEW.state BEGIN
        INSERT INTO outbox (topic, at, data) VALUES ('run.ended', NEW.updated_at, json_object(
            'run_id', NEW.id, 'kind', NEW.kind, 'state', NEW.state, 'code', NEW.code, 'cause', NEW.cause,
            'fix', NEW.fix, 'not_applied', NEW.result -> '$.not_applied'));
    END;
    CREATE TRIGGER calibration_stored AFTER INSERT ON calibrations BEGIN
        INSERT INTO outbox (topic, at, data) VALUES ('calibration.stored', NEW.created_at, json_object(
            'calibration_id', NEW.id, 'run_id', NEW.run_id, 'accepted', json(iif(NEW.accepted, 'true', 'false')),
            'camera', NEW.camera,
            'expanded_mm', NEW.document -> '$.accuracy.expanded_mm',
            'worst_point', NEW.document -> '$.accuracy.worst_point',
            'tolerance_mm', NEW.document -> '$.accuracy.tolerance_mm',
            'tolerance_stated', NEW.document -> '$.accuracy.tolerance_stated',
            'expected_mm', NEW.document -> '$.accuracy.expected_mm',
            'before_mm', NEW.document -> '$.accuracy.before_mm',
            'why', NEW.document -> '$.accuracy.why'));
    END;
    CREATE TRIGGER calibration_applied AFTER INSERT ON applied BEGIN
        INSERT INTO outbox (topic, at, data) SELECT 'calibration.applied', NEW.applied_at, json_object(
            'calibration_id', NEW.calibration_id, 'applied_by', NEW.applied_by, 'sequence', NEW.sequence,
            'camera', NEW.camera,
            'expanded_mm', document -> '$.accuracy.expanded_mm',
            'worst_point', document -> '$.accuracy.worst_point',
            'tolerance_mm', document -> '$.accuracy.tolerance_mm',
            'tolerance_stated', document -> '$.accuracy.tolerance_stated',
            'expected_mm', document -> '$.accuracy.expected_mm',
            'before_mm', document -> '$.accuracy.before_mm',
            'why', document -> '$.accuracy.why')
        FROM (SELECT iif(json_valid(document), document, '{}') AS document FROM calibrations
            WHERE id = NEW.calibration_id);
    END;
    """,
)

SCHEMA_VERSION = len(MIGRATIONS)
