"""Implemented and sampled controllers, checked in time: rounding, integers, C headers, held
plants.
"""
