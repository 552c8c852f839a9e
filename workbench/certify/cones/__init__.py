"""Conic programs from their data alone: exact membership in cones, rays, and what they prove."""
