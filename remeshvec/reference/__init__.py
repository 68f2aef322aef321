"""The input surface as the sweeps look back at it: its curves, its patches, its tree."""
