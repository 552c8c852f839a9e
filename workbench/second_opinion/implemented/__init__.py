"""Implemented and sampled controllers, tried in time: rounding, integers, headers, held plants."""
