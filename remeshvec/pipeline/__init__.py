"""One call, start to end; the only place that knows all stages."""
