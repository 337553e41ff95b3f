"""What may be missing: scored, tried in the model, and told apart by a next experiment."""
