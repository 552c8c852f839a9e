"""Every strategy over an ensemble of discs and circumstances."""
