"""Files and many meshes through the pipeline."""
