"""Why a whole session is inconsistent: known causes are tried one at a time, and the one that explains it is named."""
