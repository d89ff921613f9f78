"""Networks on the page: trained while a class looks on, all slices at once, the paper's figures."""
