"""Who may do what: roles, keys, the set-up code, certificates."""
