"""What is asked: scene files and the models that validate them."""
