"""One module a figure; the only place that draws."""
