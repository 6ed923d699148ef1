DELETE FROM browser_sessions WHERE paired; -- of which it is not known with whose end they should end
ALTER TABLE browser_sessions ADD COLUMN parent TEXT REFERENCES browser_sessions (hash) ON DELETE CASCADE;
