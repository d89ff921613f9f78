"""Even triangles: edges split, collapsed and flipped, and vertices moved along the surface (Botsch & Kobbelt 2004).

*Chosen* numbers are neither derived nor tuned: what half and twice of each change is said with it.
"""
