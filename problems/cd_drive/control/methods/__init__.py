"""The synthesis methods of Table 5.1, compared by one analysis."""
