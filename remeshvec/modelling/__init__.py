"""What a surface is remeshed for: Laplacians, fairing, editing, smoothing."""
