"""How far plants of the parametric uncertainty deviate from the nominal."""
