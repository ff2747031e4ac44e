"""The study of one paper on top of the library `fibrous`: steps, audit, figures and the report."""
