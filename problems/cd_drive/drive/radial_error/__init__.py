"""Radial errors of four methods, from the diffraction at the tracks."""
