"""Identification of the fault coefficients k1...k8 from recorded responses."""
