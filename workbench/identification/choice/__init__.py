"""The best model of a record for each use, among all kinds of models."""
