"""The loop over the operations, and what comes after the last one."""
