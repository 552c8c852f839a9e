"""The synthesis methods of Table 5.1, judged by one analysis."""
