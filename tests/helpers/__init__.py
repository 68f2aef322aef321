"""What tests share: shapes, slow twins of kernels, checks of meshes, ways to run things."""
