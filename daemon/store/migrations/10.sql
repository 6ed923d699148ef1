ALTER TABLE scan_views ADD COLUMN joints_deg TEXT; -- null where the pose came without
