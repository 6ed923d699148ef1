"""Cloud formats: headers and bodies as bytes to records and back, without file access."""
