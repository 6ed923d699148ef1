DROP TRIGGER run_changed;
UPDATE runs SET cause = json_object('code', code, 'what', cause, 'fix', fix, 'details', json_object(
    'what', json_object('id', 'as-written', 'params', json_object('sentence', cause)),
    'fix', json_object('id', 'as-written', 'params', json_object('sentence', fix)))) WHERE code IS NOT NULL;
ALTER TABLE runs DROP COLUMN code;
ALTER TABLE runs DROP COLUMN fix;
CREATE TRIGGER run_changed AFTER UPDATE OF state ON runs
WHEN NEW.state IN ('finished', 'failed', 'aborted') AND OLD.state <> NEW.state BEGIN
    INSERT INTO outbox (topic, at, data) VALUES ('run.ended', NEW.updated_at, json_object(
        'run_id', NEW.id, 'kind', NEW.kind, 'state', NEW.state, 'code', NEW.cause ->> '$.code',
        'cause', NEW.cause ->> '$.what', 'fix', NEW.cause ->> '$.fix', 'details', NEW.cause -> '$.details',
        'not_applied', NEW.result -> '$.not_applied'));
END;
