"""Diagnosis of an inconsistent session: known causes are tested one by one, and the one that explains it is named."""
