"""`lcp-lube explore`: a scene's numbers as sliders on a local page."""
