"""One module a rule: read inputs, one call into the library, write outputs."""
