"""The caller's arrays and options, checked, as arrays on a clean mesh."""
