"""The caller's arrays, options and wishes, checked and turned into arrays on a clean mesh."""
