"""What a fall of the error is worth, how sure a model is, and what speaks against an effect."""
