"""Positions and disturbances estimated while a scratch passes."""
