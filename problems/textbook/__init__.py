"""Plants of the literature: a distillation column, an unstable plant, failing actuators."""
