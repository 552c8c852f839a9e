"""The arm's parasitic resonance, measured in closed loop."""
