"""The paper's statements against what the study found: one function a statement or family of statements."""
