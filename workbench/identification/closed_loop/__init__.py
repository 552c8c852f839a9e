"""Models of plants from closed-loop records; each method states its assumptions."""
