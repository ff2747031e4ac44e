"""One module per rule: read inputs, one call into the library, write outputs."""
