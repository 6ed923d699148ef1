"""Register an archive of scans with parallel workers; results are written atomically, finished scans skipped."""
