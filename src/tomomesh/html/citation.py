"""How to cite what was used: as CITATION.cff says, which a test compares."""

PAPER = (
    "Reyes Aldasoro, C. C., & Algorri, M. E. (2000). A combined algorithm for image segmentation using neural networks "
    "and 3D surface reconstruction using dynamic meshes."
)
"""The paper whose method tomomesh implements."""


def citations(version: str) -> list[str]:
    """Return what to cite, the paper first."""
    return [PAPER, f"The tomomesh developers. tomomesh (version {version}) [computer software]."]
