"""One small script a group of options: what each of them changes, as a picture."""
