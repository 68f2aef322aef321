"""From the last mesh to what the caller gets: arrays, maps, births, report."""
