"""From a controller to a computer: order reduction, sampling, second-order sections, integers,
export.
"""
