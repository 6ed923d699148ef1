"""JSON Schemas of the files that go in and come out: `handeyed schema`."""
