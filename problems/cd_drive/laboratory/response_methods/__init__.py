"""Ways to excite a coil and to estimate its response, at equal time and amplitude."""
