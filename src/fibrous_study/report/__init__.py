"""The study as one page for readers: what it tells in which order, its tables, and the page itself; no files."""
