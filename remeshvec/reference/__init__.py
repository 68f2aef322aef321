"""The reference surface of the sweeps, made from the input: its curves, patches and tree."""
