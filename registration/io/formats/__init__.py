"""The cloud formats: headers and bodies as bytes to records and back, without files."""
