"""Plants that do not meet the assumptions of H-infinity synthesis: they are perturbed, or poles of
weights move into the controller.
"""
