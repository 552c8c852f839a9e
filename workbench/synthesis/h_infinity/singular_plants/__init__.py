"""Plants that miss assumptions of H-infinity synthesis: perturbed, or without poles of weights."""
