"""The four phases and the projection, one a file, all with the same anatomy."""
