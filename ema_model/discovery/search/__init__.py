"""The search by one evidence: Terms, the algebra of their sets, and the models that are refitted."""
