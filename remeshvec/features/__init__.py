"""Feature curves: which edges and vertices must keep their place, and the polylines they form."""
