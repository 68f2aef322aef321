"""What every module may import: types, compiler flags, threads, casts, formulas on scalars."""
