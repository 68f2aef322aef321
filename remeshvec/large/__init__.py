"""One surface in parts: rounds of tasks on files, for surfaces too large to be swept in one piece."""
