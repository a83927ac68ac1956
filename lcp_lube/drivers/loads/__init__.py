"""Places and values at which films carry what is asked of them."""
