"""Residual generators: exact, by parity relations, matched to a model, whitened."""
