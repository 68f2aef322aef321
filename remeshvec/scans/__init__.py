"""From a raw surface, as scanners and marching cubes leave it, to one that is clean and closed."""
