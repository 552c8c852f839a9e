"""Solutions of matrix equations: factors of Gramians, and Riccati equations."""
