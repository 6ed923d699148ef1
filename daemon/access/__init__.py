"""Authentication and authorisation: roles, keys, the set-up code, certificates, the chain of the audit log."""
