"""EXR files of several pictures: named layers, the views of two eyes, depth."""
