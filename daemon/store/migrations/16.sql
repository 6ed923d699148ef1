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
