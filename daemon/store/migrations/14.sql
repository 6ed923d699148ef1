ALTER TABLE scan_views ADD COLUMN points INTEGER; -- null in views from before this was stored, as bytes
ALTER TABLE scan_views ADD COLUMN bytes INTEGER;
ALTER TABLE scan_views ADD COLUMN created_by TEXT NOT NULL DEFAULT '';
