"""Studies: arms, allocation, blinding, planned visits; who must not know which arm."""
