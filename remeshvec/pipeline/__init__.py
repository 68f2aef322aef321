"""One call, from start to end: the only place that knows all stages."""
