CREATE TABLE arms ( -- the arm's errors identified with a calibration: arm.json
    calibration_id TEXT PRIMARY KEY REFERENCES calibrations (id),
    document TEXT NOT NULL
);
