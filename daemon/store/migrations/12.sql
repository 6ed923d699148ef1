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
