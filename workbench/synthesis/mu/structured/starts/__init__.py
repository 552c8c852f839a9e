"""The starts of method "fixed": one module for each rule, and the choice among the starts found."""
