"""Several rings on every slice: window -> contours."""
