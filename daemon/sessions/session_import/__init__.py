"""Makes session and scan folders from folders of other programs: `handeyed import`."""
