"""Uses of a remeshed surface: Laplacians, fairing, editing, smoothing."""
