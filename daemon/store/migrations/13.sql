ALTER TABLE scan_views ADD COLUMN external_axes TEXT; -- null where the controller has none
