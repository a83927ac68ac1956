"""Films in time: their steps, what moves in them, what a run is taken up from."""
