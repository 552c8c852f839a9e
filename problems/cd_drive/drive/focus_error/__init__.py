"""Focus error of the astigmatic and of Foucault's method, from the optics."""
