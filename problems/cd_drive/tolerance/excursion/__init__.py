"""How far the focus point strays while a defect passes."""
