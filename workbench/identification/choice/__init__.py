"""Choice of the best model of a record, among all kinds of models, for each use."""
