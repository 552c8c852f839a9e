"""Excitation signals and records, and checks whether they are fit for identification."""
