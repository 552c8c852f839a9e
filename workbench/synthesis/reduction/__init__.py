"""Order reduction of controllers: truncation, optimal Hankel norm, weighting by the closed loop."""
