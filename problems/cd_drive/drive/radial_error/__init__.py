"""Radial errors of four methods, from diffraction at the tracks."""
